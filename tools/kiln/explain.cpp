#include "tools/kiln/commands.h"
#include "tools/kiln/known_words.h"
#include <fmt/format.h>

namespace kiln {
namespace {

struct Explanation {
    const char* code;
    const char* text;
};
constexpr Explanation kExits[] = {
    {"0", "done"},
    {"1", "an internal fault: please report it with the map"},
    {"2", "usage: the command line could not be understood"},
    {"3", "an input file cannot be read or parsed"},
    {"4", "geometry: the world leaks (see --allow-leaks), or nothing valid is left to compile"},
    {"5", "a limit or budget was exceeded"},
    {"6", "a quality gate failed (--werror, --require-error, a check of verify)"},
    {"7", "cancelled: nothing was written"},
    {"8", "a file could not be written; what was there before is unchanged"},
};
constexpr Explanation kCodes[] = {
#include "tools/kiln/explanations.inc"
};

} // namespace

Command explain_command(CLI::App& app) {
    auto code = std::make_shared<std::string>();
    app.add_option("code", *code, "A code as it stands in brackets behind a message, or an exit code; none: list all. words: those of vbsp, vvis, vrad, qbsp, vis and light, and what each is here");
    app.footer("examples:\n  kiln explain leak\n  kiln explain words");
    return [code] {
        if (*code == "words") return print_output(explain_words());
        std::string text;
        for (const auto& list : {std::span<const Explanation>(kCodes), std::span<const Explanation>(kExits)})
            for (const Explanation& e : list)
                if (code->empty() || *code == e.code) text += fmt::format("{}: {}\n", e.code, e.text);
        if (!text.empty()) return print_output(text);
        print_error(fmt::format("kiln: error: no code \"{}\"; `kiln explain` lists all [usage]\n", *code));
        return static_cast<int>(Exit::usage);
    };
}

} // namespace kiln
