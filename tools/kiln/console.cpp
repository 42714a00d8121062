#include "tools/kiln/console.h"
#include <csignal>
#include <filesystem>
#include <cstdio>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

namespace kiln {
namespace {

// The one thing a signal handler may touch. A second Ctrl-C ends the process at once.
std::atomic<bool> interrupted{false};
void on_signal(int signal) {
    if (interrupted.exchange(true)) _exit(128 + signal);
}

nlohmann::ordered_json log_line(const Diagnostic& d) {
    nlohmann::ordered_json j = {{"event", "diagnostic"}, {"severity", to_text(d.severity)}, {"code", d.code}};
    if (!d.where.file.empty()) j["file"] = d.where.file;
    if (d.where.line > 0) j["line"] = d.where.line;
    if (d.where.entity >= 0) j["entity"] = d.where.entity;
    if (d.where.brush >= 0) j["brush"] = d.where.brush;
    if (d.where.side >= 0) j["side"] = d.where.side;
    j["message"] = d.message;
    return j;
}
void print_json(const nlohmann::ordered_json& j) {
    // Names in maps may be of any encoding; a log line is always valid UTF-8.
    print_error(j.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
}

} // namespace

nlohmann::ordered_json to_json(const Diagnostic& d) {
    return {{"severity", to_text(d.severity)}, {"code", d.code}, {"file", d.where.file}, {"line", d.where.line},
            {"entity", d.where.entity}, {"brush", d.where.brush}, {"side", d.where.side}, {"message", d.message}};
}

void print_error(const std::string& text) { (void)std::fwrite(text.data(), 1, text.size(), stderr); }

int print_output(const std::string& text) {
    if (std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0) return 0;
    print_error("kiln: error: standard output cannot be written [cannot-write]\n");
    return static_cast<int>(Exit::io);
}

bool same_file(const std::string& a, const std::string& b) {
    std::error_code ignored;
    return std::filesystem::equivalent(a, b, ignored);
}

Context Console::make_context(int threads) {
    std::signal(SIGINT, on_signal);
    std::signal(SIGTERM, on_signal);
    Context context;
    context.threads = threads;
    context.stop = &interrupted;
    if (!quiet) context.progress = [this](const std::string& stage, double share) { progress(stage, share); };
    return context;
}

void Console::progress(const std::string& stage, double share) {
    const auto now = std::chrono::steady_clock::now();
    if (stage != last_stage_) last_stage_ = stage, stage_start_ = now, last_drawn_ = {};
    if (std::chrono::duration<double>(now - last_drawn_).count() < 0.1) return;
    last_drawn_ = now;
    const double spent = std::chrono::duration<double>(now - stage_start_).count();
    const double left = share > 0.02 && share < 1 ? spent * (1 - share) / share : 0;
    if (format == LogFormat::json) {
        print_json({{"event", "progress"}, {"stage", stage}, {"share", share}, {"eta_s", left}});
    } else if (isatty(STDERR_FILENO)) {
        print_error(fmt::format("\r\033[K{:<24} {:3.0f} %{}", stage, share * 100, left > 1 ? fmt::format("  {:.0f} s left", left) : ""));
        std::fflush(stderr);
        line_open_ = true;
    }
}

void Console::clear_line() {
    if (line_open_) print_error("\r\033[K");
    line_open_ = false;
}

void Console::print(const Diagnostic& d) {
    told_.push_back(d);
    if (d.severity == Severity::error) ++errors_;
    if (d.severity == Severity::warning) ++warnings_;
    if (quiet && d.severity == Severity::note) return;
    clear_line();
    if (format == LogFormat::json)
        print_json(log_line(d));
    else
        print_error(to_text(d) + "\n");
}

void Console::print_new(const Context& context) {
    for (; printed_ < context.diagnostics().size(); ++printed_) print(context.diagnostics()[printed_]);
}

void Console::stage(const StageReport& s) {
    if (quiet) return;
    clear_line();
    if (format == LogFormat::json)
        print_json({{"event", "stage"}, {"name", s.name}, {"wall_s", s.wall_s}, {"cpu_s", s.cpu_s}, {"peak_rss_mb", s.peak_rss_mb}, {"cached", s.cached}});
    else
        print_error(fmt::format("{:<11} {:8.2f} s wall {:8.2f} s cpu {:7.0f} MB{}\n", s.name, s.wall_s, s.cpu_s, s.peak_rss_mb, s.cached ? "  cached" : ""));
}

void Console::say(const std::string& line) {
    if (quiet) return;
    clear_line();
    if (format == LogFormat::json)
        print_json({{"event", "message"}, {"message", line}});
    else
        print_error(line + "\n");
}

int Console::fail(const Fault& fault) {
    print(fault.diagnostic);
    return static_cast<int>(fault.exit);
}

int Console::verdict(const Context& context) {
    print_new(context);
    if (warnings_are_errors && warnings_ + errors_ > 0) {
        say(fmt::format("{} warnings and {} errors, and --werror was given", warnings_, errors_));
        return static_cast<int>(Exit::quality);
    }
    return 0;
}

} // namespace kiln
