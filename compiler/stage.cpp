#include "compiler/stage.h"

namespace kiln {

std::optional<StageRunner::Entry> StageRunner::fetch(Hash key, Hash places) {
    if (!run_.keeps()) return std::nullopt;
    bool damaged = false;
    const std::optional<Buffer> bytes = run_.store->load(key, &damaged);
    if (damaged)
        context_.report(Severity::note, "cache-damaged", "a damaged cache entry was rebuilt", {.file = run_.store->path(key)});
    if (!bytes) return std::nullopt;
    try {
        Entry entry = from_bytes<Entry>(bytes->bytes());
        if (!entry.diagnostics.empty() && entry.places != places) return std::nullopt;
        return entry;
    } catch (const ArchiveError&) {
        return std::nullopt;
    }
}

void StageRunner::keep(Hash key, const Entry& entry) {
    if (!run_.keeps()) return;
    if (!run_.store->save(key, to_bytes(entry)))
        context_.report(Severity::warning, "cache-unwritable", "a stage result could not be kept; the build goes on without",
                        {.file = run_.store->path(key)});
}

void StageRunner::finish(const char* name, const Clock& clock, bool cached) {
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - clock.wall;
    reports_.push_back({name, wall.count(), cpu_seconds() - clock.cpu, peak_rss_mb(), cached});
    context_.say(name, 1);
    if (run_.stage_done) run_.stage_done(reports_.back());
}

} // namespace kiln
