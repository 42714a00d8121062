// kiln: the command line.
#include "libs/core/check.h"
#include "tools/kiln/commands.h"
#include "tools/kiln/known_words.h"
#include <algorithm>
#include <csignal>
#include <fmt/format.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace {

using namespace kiln;

constexpr const char* kExamples = R"(examples:
  kiln build maps/atrium/atrium.vmf                  bake a level: atrium.kiln beside the map
  kiln build e1m1.map -o e1m1.kiln --error 2         finer light (5 % is the default)
  kiln build m.vmf --draft --cache ~/.cache/kiln     quick, and quicker still the second time
  kiln info atrium.kiln                              what is in a level
  kiln image atrium.kiln --view 0 -o view.png        look at it
  kiln explain leak                                  what a diagnostic code means
)";

// Help begins with what one would type.
class ExamplesFirst : public CLI::Formatter {
public:
    std::string make_footer(const CLI::App*) const override { return ""; }
    std::string make_description(const CLI::App* app) const override {
        const std::string examples = app->get_name().empty() ? "" : app->get_footer(); // groups of options inherit that of kiln itself
        return CLI::Formatter::make_description(app) + (examples.empty() ? "" : "\n" + examples + "\n\n");
    }
};

std::size_t edit_distance(const std::string& a, const std::string& b) {
    std::vector<std::size_t> row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t above = row[j];
            row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])});
            diagonal = above;
        }
    }
    return row[b.size()];
}

// "did you mean": the nearest option of the command that was called, else the nearest command.
std::string nearest(const CLI::App& app, const std::vector<std::string>& words) {
    const CLI::App* command = &app;
    for (const CLI::App* sub : app.get_subcommands()) command = sub;
    std::vector<std::string> names;
    if (command == &app)
        for (const CLI::App* sub : app.get_subcommands({})) names.push_back(sub->get_name());
    std::vector<const CLI::App*> groups = {command};
    for (const CLI::App* group : command->get_subcommands({}))
        if (group->get_name().empty()) groups.push_back(group);
    for (const CLI::App* group : groups)
        for (const CLI::Option* option : group->get_options())
            for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    std::string best;
    std::size_t best_distance = 4;
    for (const std::string& word : words) {
        if (std::find(names.begin(), names.end(), word) != names.end()) continue;
        const std::string plain = word.starts_with("--") ? word : word.starts_with("-") ? "-" + word : word;
        for (const std::string& name : names)
            if (const std::size_t d = edit_distance(plain.substr(0, plain.find('=')), name); d < best_distance) best_distance = d, best = name;
    }
    return best;
}

} // namespace

int main(int argc, char** argv) {
#ifdef __GLIBC__
    // What a stage gives back the next one needs again: kept, not asked of the system anew and zeroed page by page.
    mallopt(M_MMAP_THRESHOLD, 1 << 30), mallopt(M_TRIM_THRESHOLD, 1 << 30), mallopt(M_TOP_PAD, 64 << 20);
#endif
    std::signal(SIGXFSZ, SIG_IGN); // a file that may not grow is a write error with a message, not a death
    CLI::App app("kiln: compiles and lights brush levels", "kiln");
    app.formatter(std::make_shared<ExamplesFirst>()); // the commands inherit it
    app.set_version_flag("--version", kVersion);
    app.footer(kExamples);
    app.require_subcommand(1);
    app.get_formatter()->column_width(34);

    Command chosen;
    const std::pair<const char*, std::pair<const char*, Command (*)(CLI::App&)>> commands[] = {
        {"build", {"Bake a map into a level file", build_command}},
        {"info", {"Say what a level file or a map holds", info_command}},
        {"dump", {"Write any artefact on the way from a map as stable text or JSON", dump_command}},
        {"vis", {"Visibility alone, of a map or of another compiler's portal file", vis_command}},
        {"trace", {"Say why two places see each other: a line, or the chain of portals", trace_command}},
        {"verify", {"Check every invariant of a map on its way, or of a level file", verify_command}},
        {"export", {"Write OBJ of any stage, or glTF of the render mesh", export_command}},
        {"image", {"Render pictures of a level file", image_command}},
        {"sample", {"Evaluate what a level stores at given points", sample_command}},
        {"gather", {"Directional integrals at given points by the baking code", gather_command}},
        {"reference", {"The same integrals path-traced, with standard errors", reference_command}},
        {"bench", {"Measure error against time", bench_command}},
        {"explain", {"Explain a diagnostic code or exit code", explain_command}},
    };
    std::vector<std::pair<CLI::App*, Command>> runners;
    for (const auto& [name, rest] : commands) {
        CLI::App* command = app.add_subcommand(name, rest.first);
        command->get_formatter()->column_width(34);
        runners.emplace_back(command, rest.second(*command));
    }

    std::vector<std::string> notes;
    const auto translated = translate_known_words(argc, argv, notes);
    if (!translated) {
        print_error(fmt::format("kiln: error: {} [usage]\nkiln: `kiln explain words` lists words of other compilers\n", translated.fault().diagnostic.message));
        return static_cast<int>(Exit::usage);
    }
    const std::vector<std::string>& words = *translated;
    try {
        std::vector<std::string> reversed(words.rbegin(), words.rend());
        app.parse(std::move(reversed));
    } catch (const CLI::Success& e) {
        return app.exit(e);
    } catch (const CLI::ParseError& e) {
        print_error(fmt::format("kiln: error: {} [usage]\n", e.what()));
        if (const std::string guess = nearest(app, words); !guess.empty()) print_error(fmt::format("kiln: did you mean {}?\n", guess));
        print_error(fmt::format("kiln: `kiln --help` and `kiln COMMAND --help` list what there is, `kiln explain words` words of other compilers\n"));
        return static_cast<int>(Exit::usage);
    }
    const bool json = std::ranges::adjacent_find(words, [](const auto& a, const auto& b) { return a == "--log-format" && b == "json"; }) != words.end() ||
                      std::ranges::find(words, "--log-format=json") != words.end();
    for (const std::string& note : notes)
        print_error(json ? fmt::format("{{\"event\":\"message\",\"message\":\"{}\"}}\n", note) : fmt::format("kiln: note: {}\n", note));
    try {
        for (const auto& [command, run] : runners)
            if (command->parsed()) return run();
    } catch (const std::bad_alloc&) {
        print_error(fmt::format("kiln: error: out of memory [out-of-memory]\n"));
        return static_cast<int>(Exit::limit);
    } catch (const Cancelled&) {
        print_error(fmt::format("kiln: error: cancelled; nothing was written [cancelled]\n"));
        return static_cast<int>(Exit::cancelled);
    } catch (const std::exception& e) {
        print_error(fmt::format("kiln: internal error: {} [internal]\n", e.what()));
    }
    return static_cast<int>(Exit::internal);
}
