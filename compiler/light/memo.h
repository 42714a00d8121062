// What a bake came to, place by place, and what each place depended on. A later bake of the same geometry takes over what would
// come out the same, bit by bit, and does the rest anew; lights, emission and reflectance may differ.
#pragma once
#include "libs/core/hash.h"
#include <vector>

namespace kiln {

// What a computation looked at: parts (patches), each once.
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

// Results of a step that is done item by item. Items may be asked for and kept in parallel, each by one thread at a time.
class StepMemo {
public:
    // What the last run kept is looked up from now on; only what this one asks for or keeps is kept again.
    void begin(std::size_t items);
    // The value kept for an item, if it was made from `key` and from parts whose states were what they are; null: there is none.
    const Bytes* find(std::size_t item, std::uint64_t key, const std::vector<std::uint64_t>& states);
    void keep(std::size_t item, std::uint64_t key, const std::vector<std::uint64_t>& states, const std::vector<std::uint32_t>& parts, Bytes value);
    void end() { was_.clear(); }
    std::array<std::size_t, 2> taken_over() const; // entries found; of those there are
    template <class A> void fields(A& a) { a(now_); }

private:
    struct Entry {
        std::uint64_t key = 0, seen = 0;
        Bytes parts, value; // parts: differences, a few bits a byte
        bool found = false;
        template <class A> void fields(A& a) { a(key, seen, parts, value); }
    };
    std::vector<std::vector<Entry>> was_, now_;
};

// Of one table of patches.
struct PatchMemo {
    Hash table; // the patches, and how many rays each has
    bool traced = false;
    std::vector<std::uint32_t> hits; // Bake::hits_ and what belongs to it
    std::vector<std::uint8_t> cells, covered;
    std::array<std::uint64_t, 3> counts{};
    StepMemo lights, direct, gather, pilot;
    template <class A> void fields(A& a) { a(table, traced, hits, cells, covered, counts, lights, direct, gather, pilot); }
};

struct LightMemo {
    std::vector<PatchMemo> tables; // in the order of their use
    double taken_over() const;     // share of what the last bake gathered, 0..1
    template <class A> void fields(A& a) { a(tables); }
};

// Of things that are bytes and nothing else.
template <class... T> std::uint64_t hash64(const T&... values) {
    ByteWriter w;
    w(values...);
    return hash_bytes(w.bytes).low;
}

} // namespace kiln
