// ContentStore: stage results on disk under the hash of what they were made from. Entries carry the hash of their
// bytes, are verified on read and written atomically: a damaged, truncated or half-written entry is a miss, never a
// wrong answer. Several processes may share a folder. What is loaded is mapped: nobody may change an entry in place, to remove or replace it is no harm.
#pragma once
#include "libs/core/file.h"
#include "libs/core/hash.h"
#include <optional>
#include <span>
#include <string>

namespace kiln {

class ContentStore {
public:
    explicit ContentStore(std::string folder) : folder_(std::move(folder)) {} // empty: never holds anything
    bool enabled() const { return !folder_.empty(); }
    // The bytes stored under `key`; nothing where there are none or they are damaged (then *damaged = true).
    std::optional<Buffer> load(Hash key, bool* damaged = nullptr) const;
    // False where the entry could not be written (full disk, no rights): the build goes on without it. `compressed`: for what is kept
    // in many versions; what is read and written again by each run is better as it is.
    bool save(Hash key, std::span<const std::uint8_t> bytes, bool compressed = true) const;
    std::string path(Hash key) const;

private:
    std::string folder_;
};

} // namespace kiln
