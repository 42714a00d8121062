// What an earlier bake of the same geometry came to, place by place, and what each place depended on. What would come out the same,
// bit by bit, is taken over, the rest done anew; lights, emission and reflectance may differ.
#pragma once
#include "libs/core/hash.h"
#include <functional>
#include <mutex>
#include <unordered_map>
#include <vector>

namespace kiln {

// What a computation looked at: parts of a whole, each once.
class Looked {
public:
    void begin(std::size_t parts) {
        if (stamp_.size() != parts) stamp_.assign(parts, 0), now_ = 0;
        ++now_, parts_.clear();
    }
    void at(std::uint32_t part) {
        if (stamp_[part] != now_) stamp_[part] = now_, parts_.push_back(part);
    }
    const std::vector<std::uint32_t>& parts() const { return parts_; }

private:
    std::vector<std::uint32_t> stamp_, parts_;
    std::uint32_t now_ = 0;
};

// Results under a key that stands for everything they are made from but the parts looked at. Any number of threads.
class Memo {
public:
    // What the last run kept is looked up from now on; only what this one finds or keeps is kept again.
    void begin();
    // The value under `key`, if the parts it was made from have the states that they had then; null: there is none.
    // Valid until the next begin().
    const Bytes* find(std::uint64_t key, const std::vector<std::uint64_t>& states);
    void keep(std::uint64_t key, const std::vector<std::uint64_t>& states, const std::vector<std::uint32_t>& parts, Bytes value);
    void end(); // forgets what was not asked for
    std::size_t found() const; // entries of the last run that this one has
    std::size_t size() const;
    template <class A> void fields(A& a) {
        std::vector<std::pair<std::uint64_t, Entry>> all;
        for (Shard& s : shards_)
            for (auto& [key, entry] : s.now) all.emplace_back(key, std::move(entry));
        for (Shard& s : shards_) s.now.clear();
        a(all);
        for (auto& [key, entry] : all) shard(key).now.emplace(key, std::move(entry));
    }

private:
    struct Entry {
        std::uint64_t seen = 0;
        Bytes parts, value; // parts: differences, a few bits a byte
        bool found = false;
        template <class A> void fields(A& a) { a(seen, parts, value); }
    };
    struct Shard {
        std::mutex mutex;
        std::unordered_map<std::uint64_t, Entry> was, now;
        Shard() = default;
        Shard(const Shard& o) : was(o.was), now(o.now) {}
        Shard& operator=(const Shard& o) {
            was = o.was, now = o.now;
            return *this;
        }
    };
    Shard& shard(std::uint64_t key) { return shards_[key % shards_.size()]; }
    std::vector<Shard> shards_ = std::vector<Shard>(64);
};

// Kept for one geometry: surfaces, and what blocks light or lets it through. Another needs another memo, and other rows.
struct LightMemo {
    Memo lights, direct, gather, pilot; // of all tables of patches
    // Form-factor rows depend on geometry alone and are most of what a bake keeps: each table of patches lies in the store by itself,
    // under a hash of it. Where they are found and left; absent: they are traced.
    std::function<std::optional<Bytes>(Hash table)> load_rows;
    std::function<void(Hash table, Bytes rows)> save_rows;
    double taken_over() const; // share of what the last bake gathered, 0..1
    template <class A> void fields(A& a) { a(lights, direct, gather, pilot); }
};

} // namespace kiln
