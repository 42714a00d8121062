#include "compiler/light/memo.h"
#include "libs/core/check.h"
#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

namespace kiln {

std::uint64_t key_in(const Box3& box, Vec3 point, std::uint64_t hash) {
    constexpr int kBits = 4;
    std::uint64_t place = 0;
    for (std::size_t a = 0; a < 3; ++a) {
        const double size = box.hi[a] - box.lo[a], share = size > 0 && std::isfinite(size) ? (point[a] - box.lo[a]) / size : 0;
        const auto at = static_cast<std::uint64_t>(std::clamp(share * (1 << kBits), 0.0, (1 << kBits) - 1.0));
        for (int b = 0; b < kBits; ++b) place |= (at >> b & 1) << (3 * b + static_cast<int>(a));
    }
    return key_at(place, std::uint64_t{1} << (3 * kBits), hash);
}

namespace {

// Seven bits a byte, the highest says that more follow; differences with their sign in the lowest bit.
Bytes packed(const std::vector<std::uint32_t>& parts) {
    Bytes out;
    out.reserve(2 * parts.size());
    std::uint32_t last = 0;
    for (const std::uint32_t p : parts) {
        const auto d = static_cast<std::int64_t>(p) - static_cast<std::int64_t>(last);
        last = p;
        for (std::uint64_t z = d < 0 ? static_cast<std::uint64_t>(-d) * 2 - 1 : static_cast<std::uint64_t>(d) * 2;; z >>= 7) {
            out.push_back(static_cast<std::uint8_t>((z & 127) | (z > 127 ? 128 : 0)));
            if (z <= 127) break;
        }
    }
    return out;
}

// The states of packed parts taken together; false: these are none.
bool seen_of(std::span<const std::uint8_t> parts, const std::vector<std::uint64_t>& states, std::uint64_t* seen) {
    std::uint64_t sum = parts.size();
    std::int64_t part = 0;
    for (std::size_t i = 0; i < parts.size();) {
        std::uint64_t z = 0;
        for (int shift = 0;; shift += 7) {
            if (i == parts.size() || shift > 35) return false;
            const std::uint8_t b = parts[i++];
            z |= static_cast<std::uint64_t>(b & 127) << shift;
            if (!(b & 128)) break;
        }
        part += z & 1 ? -static_cast<std::int64_t>(z / 2) - 1 : static_cast<std::int64_t>(z / 2);
        if (part < 0 || static_cast<std::size_t>(part) >= states.size()) return false;
        sum = chained(sum, states[static_cast<std::size_t>(part)]);
    }
    *seen = mix(sum);
    return true;
}

} // namespace

std::size_t Memo::Table::entry(std::uint64_t key) const {
    KILN_CHECK_OP(from.size(), >, 1u);
    const std::size_t range = from.size() > 2 ? key >> (65 - std::bit_width(from.size() - 1)) : 0;
    const auto end = entries.begin() + from[range + 1], at = std::lower_bound(entries.begin() + from[range], end, key, [](const Entry& e, std::uint64_t k) { return e.key < k; });
    return at != end && at->key == key ? static_cast<std::size_t>(at - entries.begin()) : entries.size();
}

void Memo::Table::begin() {
    std::uint64_t end = 0;
    for (const Entry& e : entries) { // they may come from a file
        if (e.parts < end || e.value < e.parts || e.end < e.value || e.end > bytes().size()) clear();
        if (entries.empty()) break;
        end = e.end;
    }
    found.assign(entries.size(), 0), changed = false;
    // Keys are spread evenly, or nearly so: a few entries in each at most.
    const std::size_t ranges = std::bit_ceil(entries.size() + 1);
    from.assign(ranges + 1, static_cast<std::uint32_t>(entries.size()));
    for (std::size_t i = entries.size(); i-- > 0;) from[ranges > 1 ? entries[i].key >> (65 - std::bit_width(ranges)) : 0] = static_cast<std::uint32_t>(i);
    for (std::size_t r = ranges; r-- > 0;) from[r] = std::min(from[r], from[r + 1]);
}

Memo::Table Memo::Table::of(std::vector<Entry> entries, Bytes bytes) {
    Table out;
    out.entries = std::move(entries), out.own_ = std::move(bytes), out.changed = true;
    return out;
}

Memo::Table Memo::Table::of(Buffer file) {
    Table out;
    out.file_ = std::make_shared<const Buffer>(std::move(file));
    ByteReader r(out.file_->bytes());
    std::uint64_t size = 0;
    out.entries = {r.view<Entry>(), out.file_};
    r(size); // bytes: their number, then they themselves
    if (size != r.left()) throw ArchiveError("archive length differs from what is left");
    out.from_ = out.file_->bytes().size() - size;
    return out;
}

void Memo::begin() {
    for (Table& t : tables_) t.begin();
    for (Shard& s : shards_) s.kept.clear();
    kept_.clear();
}

std::optional<std::span<const std::uint8_t>> Memo::find(std::uint64_t key, const std::vector<std::uint64_t>& states) {
    std::uint64_t seen = 0;
    if (kept_.at(key).load(std::memory_order_relaxed)) {
        Shard& s = shard(key);
        const std::lock_guard lock(s.mutex);
        if (const auto again = s.kept.find(key); again != s.kept.end()) {
            if (!seen_of(again->second.parts, states, &seen) || seen != again->second.seen) return std::nullopt;
            return again->second.value;
        }
    }
    for (Table& t : tables_) {
        const std::size_t at = t.entry(key);
        if (at == t.entries.size()) continue;
        const Entry& e = t.entries[at];
        if (!seen_of(t.part(e.parts, e.value), states, &seen) || seen != e.seen) continue;
        std::atomic_ref(t.found[at]).store(1, std::memory_order_relaxed);
        return t.part(e.value, e.end);
    }
    return std::nullopt;
}

void Memo::keep(std::uint64_t key, const std::vector<std::uint64_t>& states, const std::vector<std::uint32_t>& parts, const Bytes& value) {
    Fresh e{0, packed(parts), value};
    if (!seen_of(e.parts, states, &e.seen)) return;
    Shard& s = shard(key);
    const std::lock_guard lock(s.mutex);
    s.kept.insert_or_assign(key, std::move(e)), kept_.at(key) = 1;
}

void Memo::renew(std::uint64_t key, const std::vector<std::uint64_t>& states, const Bytes& value) {
    Shard& s = shard(key);
    const std::lock_guard lock(s.mutex);
    if (const auto again = s.kept.find(key); again != s.kept.end()) {
        again->second.value = value;
        return;
    }
    for (Table& t : tables_) {
        const std::size_t at = t.entry(key);
        if (at == t.entries.size()) continue;
        const Entry& e = t.entries[at];
        std::uint64_t seen = 0;
        const auto parts = t.part(e.parts, e.value);
        if (!seen_of(parts, states, &seen) || seen != e.seen) continue;
        s.kept.insert_or_assign(key, Fresh{e.seen, Bytes(parts.begin(), parts.end()), value}), kept_.at(key) = 1;
        return;
    }
}

void Memo::end() {
    struct Of {
        std::uint64_t key = 0;
        int age = 0;
        std::uint64_t seen = 0;
        std::span<const std::uint8_t> parts, value;
    };
    std::vector<Of> kept;
    for (const Shard& s : shards_)
        for (const auto& [key, e] : s.kept) kept.push_back({key, 0, e.seen, e.parts, e.value});
    kept_count_ = kept.size(), found_count_ = 0;
    for (Table& t : tables_) {
        for (const Of& k : kept) // stands for what was found of it before
            if (const std::size_t at = t.entry(k.key); at < t.entries.size()) t.found[at] = 0;
        found_count_ += static_cast<std::size_t>(std::ranges::count(t.found, 1));
    }
    if (!kept.empty()) {
        // What was kept and what is in the tables; of each key the latest.
        const auto joined = [&](std::span<const Table> tables, bool found_only) {
            std::vector<Of> of = kept;
            for (const Table& t : tables)
                for (std::size_t i = 0; i < t.entries.size(); ++i) {
                    const Entry& e = t.entries[i];
                    if (!found_only || t.found[i]) of.push_back({e.key, 1 + static_cast<int>(&t - tables.data()), e.seen, t.part(e.parts, e.value), t.part(e.value, e.end)});
                }
            std::ranges::sort(of, {}, [](const Of& o) { return std::pair(o.key, o.age); });
            const auto twice = std::ranges::unique(of, {}, &Of::key);
            of.erase(twice.begin(), twice.end());
            return of;
        };
        const auto bytes_of = [](const std::vector<Of>& of) {
            std::size_t bytes = 0;
            for (const Of& o : of) bytes += o.parts.size() + o.value.size();
            return bytes;
        };
        const auto table_of = [&](const std::vector<Of>& of) {
            std::vector<Entry> entries;
            Bytes bytes;
            entries.reserve(of.size()), bytes.reserve(bytes_of(of));
            for (const Of& o : of) {
                Entry& e = entries.emplace_back(o.key, o.seen, bytes.size());
                bytes.insert(bytes.end(), o.parts.begin(), o.parts.end()), e.value = bytes.size();
                bytes.insert(bytes.end(), o.value.begin(), o.value.end()), e.end = bytes.size();
            }
            return Table::of(std::move(entries), std::move(bytes));
        };
        auto& [recent, all] = tables_;
        const std::vector<Of> more = joined(std::span(&recent, 1), false);
        if (2 * (bytes_of(more) + more.size() * sizeof(Entry)) > all.bytes().size() + all.entries.size() * sizeof(Entry)) {
            const bool had = !recent.entries.empty();
            all = table_of(joined(tables_, true)), recent = {}, recent.changed = had;
        } else {
            recent = table_of(more);
        }
    }
    for (Table& t : tables_) t.found.clear(), t.from.clear();
    for (Shard& s : shards_) s.kept.clear();
}

double LightMemo::taken_over() const {
    return gather.size() ? static_cast<double>(gather.found()) / static_cast<double>(gather.size()) : 0;
}

} // namespace kiln
