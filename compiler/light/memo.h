// What an earlier bake of the same geometry came to, place by place, and what each place depended on. What would come out the same,
// bit by bit, is taken over, the rest done anew; lights, emission and reflectance may differ.
#pragma once
#include "libs/core/file.h"
#include "libs/core/hash.h"
#include "libs/core/held.h"
#include "libs/math/vec.h"
#include <array>
#include <atomic>
#include <bit>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

namespace kiln {

// One state after the other, cheaper than mix(), with which it has to end.
constexpr std::uint64_t chained(std::uint64_t sum, std::uint64_t state) {
    return (sum ^ state) * 0x9E3779B97F4A7C15ull + (sum >> 29);
}
inline std::uint64_t chained(std::uint64_t sum, Rgb light) {
    const auto bits = [](float x) { return std::uint64_t{std::bit_cast<std::uint32_t>(x)}; };
    return chained(chained(sum, bits(light.x) | bits(light.y) << 32), bits(light.z));
}

// A key of something at one of so many places. What is asked for place by place then lies so, in tables of keys and in their bytes.
constexpr std::uint64_t key_at(std::uint64_t place, std::uint64_t places, std::uint64_t hash) {
    const std::uint64_t each = ~std::uint64_t{0} / places;
    return place * each + hash % each;
}

// The same of a point in a box: by parts of a 16th of the box a side, along a curve that fills it.
std::uint64_t key_in(const Box3& box, Vec3 point, std::uint64_t hash);

// Values as they lie.
template <class T> std::span<const std::uint8_t> raw_bytes(const std::vector<T>& values) {
    static_assert(detail::Raw<T>);
    return {reinterpret_cast<const std::uint8_t*>(values.data()), values.size() * sizeof(T)};
}

// As from_bytes, into what may have room for it already.
template <class T> void read_whole(std::span<const std::uint8_t> bytes, T& value) {
    ByteReader r(bytes);
    r(value);
    if (r.left()) throw ArchiveError("archive holds more than its value");
}

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
    // What the last runs kept is looked up from now on.
    void begin();
    // The value under `key`, if the parts it was made from have the states that they had then. Valid until it is renewed or the run ends: a key is
    // one thread's at a time.
    std::optional<std::span<const std::uint8_t>> find(std::uint64_t key, const std::vector<std::uint64_t>& states);
    void keep(std::uint64_t key, const std::vector<std::uint64_t>& states, const std::vector<std::uint32_t>& parts, const Bytes& value);
    void renew(std::uint64_t key, const std::vector<std::uint64_t>& states, const Bytes& value); // of an entry that was found in these states
    // What was kept joins what the last runs kept, in a table of its own, which is the smaller one and written alone. Where that is more than half of the others,
    // what was found or kept becomes one table, and all else is forgotten.
    void end();
    struct Entry { // its parts, as differences, a few bits a byte; then its value
        static constexpr bool kRawBytes = true;
        std::uint64_t key = 0, seen = 0, parts = 0, value = 0, end = 0; // the last three: places in the bytes
    };
    struct Table {
        Held<Entry> entries; // by key
        std::vector<std::uint32_t> from; // the first entry of each of equal ranges of keys, which are a power of two, and one more: in this run
        std::vector<std::uint8_t> found; // per entry, in this run
        bool changed = false;            // by the last run
        void begin();
        std::size_t entry(std::uint64_t key) const; // its number; as many as there are: none
        std::span<const std::uint8_t> bytes() const { return file_ ? file_->bytes().subspan(from_) : std::span<const std::uint8_t>(own_); }
        std::span<const std::uint8_t> part(std::uint64_t from, std::uint64_t to) const { return bytes().subspan(from, to - from); }
        void clear() { entries = {}, own_.clear(), file_.reset(); }
        static Table of(std::vector<Entry> entries, Bytes bytes); // as this run has made it
        static Table of(Buffer file); // as it is written, without a copy; throws ArchiveError
        template <class A> void fields(A& a) {
            if constexpr (std::is_same_v<A, ByteWriter>) {
                a(entries, std::uint64_t{bytes().size()}), a.raw(bytes().data(), bytes().size());
            } else {
                std::vector<Entry> own;
                file_.reset(), a(own, own_), entries = std::move(own);
            }
        }

    private:
        Bytes own_;                          // made by this run, or
        std::shared_ptr<const Buffer> file_; // read, from there on
        std::size_t from_ = 0;
    };
    // First what the last runs kept. An entry stands for itself: any two tables of one geometry go together.
    std::array<Table, 2>& tables() { return tables_; }
    std::size_t found() const { return found_count_; } // by the last run, of what there had been
    std::size_t size() const { return found_count_ + kept_count_; }
    template <class A> void fields(A& a) { a(tables_); }

private:
    struct Fresh {
        std::uint64_t seen = 0;
        Bytes parts, value;
    };
    struct Shard {
        std::mutex mutex;
        std::unordered_map<std::uint64_t, Fresh> kept;
        Shard() = default;
        Shard(const Shard& o) : kept(o.kept) {}
        Shard& operator=(const Shard& o) {
            kept = o.kept;
            return *this;
        }
    };
    Shard& shard(std::uint64_t key) { return shards_[key % shards_.size()]; }
    // Keys that may have been kept in this run, by a few of their bits: most that are looked up have not.
    struct Hint {
        std::vector<std::atomic<std::uint8_t>> of = std::vector<std::atomic<std::uint8_t>>(std::size_t{1} << 17);
        Hint() = default;
        Hint(const Hint& o) { *this = o; }
        Hint& operator=(const Hint& o) {
            for (std::size_t i = 0; i < of.size(); ++i) of[i].store(o.of[i].load(std::memory_order_relaxed), std::memory_order_relaxed);
            return *this;
        }
        void clear() {
            for (std::atomic<std::uint8_t>& byte : of) byte.store(0, std::memory_order_relaxed);
        }
        std::atomic<std::uint8_t>& at(std::uint64_t key) { return of[key % of.size()]; }
    } kept_;
    std::array<Table, 2> tables_; // recent, all
    std::vector<Shard> shards_ = std::vector<Shard>(64);
    std::size_t found_count_ = 0, kept_count_ = 0;
};

// What an earlier run has made under that key, or makes it. No memo: it is made.
template <class T, class Make> T known_or(Memo* memo, std::uint64_t key, const Make& make) {
    if (const auto kept = memo ? memo->find(key, {}) : std::nullopt) return from_bytes<T>(*kept);
    T made = make();
    if (memo) memo->keep(key, {}, {}, to_bytes(made));
    return made;
}

// Kept for one geometry: surfaces, and what blocks light or lets it through. Another needs another memo, and other rows.
struct LightMemo {
    Memo lights, direct, gather, smooth, pilot; // of all tables of patches
    // Form-factor rows depend on geometry alone and are most of what a bake keeps: each table of patches lies in the store by itself,
    // under a hash of it. Where they are found and left; absent: they are traced.
    std::function<std::optional<Buffer>(Hash table)> load_rows;
    std::function<void(Hash table, Bytes rows)> save_rows;
    double taken_over() const; // share of what the last bake gathered, 0..1
    std::vector<Memo*> all() { return {&lights, &direct, &gather, &smooth, &pilot}; }
    template <class A> void fields(A& a) { a(lights, direct, gather, smooth, pilot); }
};

} // namespace kiln
