// One stage of the way: run it or fetch it, time it, keep what it reported.
#pragma once
#include "compiler/compile.h"
#include "libs/core/process.h"
#include <chrono>

namespace kiln {

// Keys of the stage cache name what a stage may read and nothing else. `content` grows along the way.
class StageRunner {
public:
    StageRunner(const CompileRun& run, Context& context, std::vector<StageReport>& reports)
        : run_(run), context_(context), reports_(reports) {}

    // Runs `make` -> Result<T> or loads its value. `version`: raise it when the stage's result changes for equal input.
    // `places`: what only the text of diagnostics depends on (line numbers); an entry with diagnostics is used only
    // where that is equal too. Gives the hash of the value, for the keys of the stages that read it.
    // `whole`: asked after `make`; false: another run would give more, the value is not kept.
    template <class T, class Make>
    Result<Hash> run(Stage stage, std::uint32_t version, Hash inputs, Hash places, T& value, Make&& make, const std::function<bool()>& whole = {}) {
        context_.check_cancelled();
        const Clock clock;
        const char* name = kStageNames[static_cast<std::size_t>(stage)];
        context_.say(name, 0);
        const Hash key = hash_of(std::make_pair(std::string(name), std::make_pair(version, inputs)));
        if (std::optional<Entry> entry = fetch(key, places)) {
            try {
                value = from_bytes<T>(entry->value);
                for (Diagnostic& d : entry->diagnostics) context_.report(std::move(d));
                finish(name, clock, true);
                return hash_bytes(entry->value);
            } catch (const ArchiveError&) { // written by a build with other structures: as good as absent
            }
        }
        const std::size_t reported = context_.diagnostics().size();
        Result<T> made = make();
        if (!made) {
            finish(name, clock, false);
            return made.fault();
        }
        value = *std::move(made);
        Entry entry{places, {}, to_bytes(value)};
        const auto& all = context_.diagnostics();
        entry.diagnostics.assign(all.begin() + static_cast<std::ptrdiff_t>(reported), all.end());
        if (!whole || whole()) keep(key, entry);
        finish(name, clock, false);
        return hash_bytes(entry.value);
    }
    // A stage that is too cheap to keep.
    template <class T, class Make> Result<bool> run_always(Stage stage, T& value, Make&& make) {
        context_.check_cancelled();
        const Clock clock;
        const char* name = kStageNames[static_cast<std::size_t>(stage)];
        context_.say(name, 0);
        Result<T> made = make();
        finish(name, clock, false);
        if (!made) return made.fault();
        value = *std::move(made);
        return true;
    }

private:
    struct Clock {
        std::chrono::steady_clock::time_point wall = std::chrono::steady_clock::now();
        double cpu = cpu_seconds();
    };
    struct Entry {
        Hash places;
        std::vector<Diagnostic> diagnostics;
        Bytes value;
        template <class A> void fields(A& a) { a(places, diagnostics, value); }
    };
    std::optional<Entry> fetch(Hash key, Hash places);
    void keep(Hash key, const Entry& entry);
    void finish(const char* name, const Clock& clock, bool cached);

    const CompileRun& run_;
    Context& context_;
    std::vector<StageReport>& reports_;
};

} // namespace kiln
