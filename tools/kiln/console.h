// What the command line says and how: progress, diagnostics, errors; as text for people, as JSON lines for machines.
#pragma once
#include "compiler/compile.h"
#include <chrono>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace kiln {

enum class LogFormat { text, json };

// Standard error, come what may: a log that cannot be written must not end the build.
void print_error(const std::string& text);
// Standard output; the exit code: 8 where it cannot take the text.
int print_output(const std::string& text);
// Do both names lead to one file? What a command writes must not be what it reads.
bool same_file(const std::string& a, const std::string& b);

// For reports: every field, -1 and 0 where it is not known.
nlohmann::ordered_json to_json(const Diagnostic& diagnostic);

class Console {
public:
    LogFormat format = LogFormat::text;
    bool quiet = false;          // no progress, no stage lines
    bool warnings_are_errors = false;

    // A context whose progress goes to this console and that Ctrl-C cancels.
    Context make_context(int threads);
    void print(const Diagnostic& diagnostic);
    // Prints what the context has gathered since the last call, in order.
    void print_new(const Context& context);
    void stage(const StageReport& stage);
    void say(const std::string& line); // a result line on standard error; dropped when quiet
    // Prints the fault and gives its exit code.
    int fail(const Fault& fault);
    // 0, or the code for warnings where --werror asks for it.
    int verdict(const Context& context);
    // All that was told, faults too, also what `quiet` kept from standard error.
    const std::vector<Diagnostic>& told() const { return told_; }

private:
    void progress(const std::string& stage, double share);
    void clear_line();
    std::vector<Diagnostic> told_;
    std::size_t printed_ = 0;
    bool line_open_ = false;
    std::string last_stage_;
    std::chrono::steady_clock::time_point stage_start_{}, last_drawn_{};
    std::uint32_t errors_ = 0, warnings_ = 0;
};

} // namespace kiln
