#include "compiler/light/memo.h"
#include <algorithm>
#include <atomic>

namespace kiln {
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

std::uint64_t chained(std::uint64_t sum, std::uint64_t state) {
    return (sum ^ state) * 0x9E3779B97F4A7C15ull + (sum >> 29);
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

const Memo::Entry* Memo::entry(std::uint64_t key) const {
    const auto at = std::ranges::lower_bound(entries_, key, {}, &Entry::key);
    return at == entries_.end() || at->key != key ? nullptr : &*at;
}

void Memo::begin() {
    std::uint64_t end = 0;
    for (const Entry& e : entries_) { // they may come from a file
        if (e.parts < end || e.value < e.parts || e.end < e.value || e.end > bytes_.size()) entries_.clear();
        if (entries_.empty()) break;
        end = e.end;
    }
    found_.assign(entries_.size(), 0);
    for (Shard& s : shards_) s.kept.clear();
}

std::optional<std::span<const std::uint8_t>> Memo::find(std::uint64_t key, const std::vector<std::uint64_t>& states) {
    std::uint64_t seen = 0;
    {
        Shard& s = shard(key);
        const std::lock_guard lock(s.mutex);
        if (const auto again = s.kept.find(key); again != s.kept.end()) {
            if (!seen_of(again->second.parts, states, &seen) || seen != again->second.seen) return std::nullopt;
            return again->second.value;
        }
    }
    const Entry* e = entry(key);
    if (!e || !seen_of(bytes(e->parts, e->value), states, &seen) || seen != e->seen) return std::nullopt;
    std::atomic_ref(found_[static_cast<std::size_t>(e - entries_.data())]).store(1, std::memory_order_relaxed);
    return bytes(e->value, e->end);
}

void Memo::keep(std::uint64_t key, const std::vector<std::uint64_t>& states, const std::vector<std::uint32_t>& parts, const Bytes& value) {
    Fresh e{0, packed(parts), value};
    if (!seen_of(e.parts, states, &e.seen)) return;
    Shard& s = shard(key);
    const std::lock_guard lock(s.mutex);
    s.kept.insert_or_assign(key, std::move(e));
}

void Memo::renew(std::uint64_t key, const Bytes& value) {
    Shard& s = shard(key);
    const std::lock_guard lock(s.mutex);
    if (const auto again = s.kept.find(key); again != s.kept.end()) {
        again->second.value = value;
    } else if (const Entry* e = entry(key)) {
        const auto parts = bytes(e->parts, e->value);
        s.kept.insert_or_assign(key, Fresh{e->seen, Bytes(parts.begin(), parts.end()), value});
    }
}

void Memo::end() {
    constexpr std::uint64_t kWorthWriting = 20; // one part in so many
    std::vector<std::pair<std::uint64_t, const Fresh*>> kept;
    std::uint64_t fresh = 0, all = 0;
    for (const Shard& s : shards_)
        for (const auto& [key, e] : s.kept) {
            kept.emplace_back(key, &e), fresh += e.parts.size() + e.value.size();
            if (const Entry* old = entry(key)) found_[static_cast<std::size_t>(old - entries_.data())] = 0;
        }
    std::ranges::sort(kept);
    found_count_ = static_cast<std::size_t>(std::ranges::count(found_, 1)), kept_count_ = kept.size();
    for (std::size_t i = 0; i < entries_.size(); ++i)
        if (found_[i]) all += entries_[i].end - entries_[i].parts;
    all += fresh;
    changed_ = fresh * kWorthWriting > all;
    if (changed_) {
        std::vector<Entry> entries;
        Bytes bytes_now;
        entries.reserve(size()), bytes_now.reserve(all);
        const auto put = [&](std::uint64_t key, std::uint64_t seen, std::span<const std::uint8_t> parts, std::span<const std::uint8_t> value) {
            Entry e{key, seen, bytes_now.size(), 0, 0};
            bytes_now.insert(bytes_now.end(), parts.begin(), parts.end()), e.value = bytes_now.size();
            bytes_now.insert(bytes_now.end(), value.begin(), value.end()), e.end = bytes_now.size();
            entries.push_back(e);
        };
        std::size_t k = 0;
        for (std::size_t i = 0; i <= entries_.size(); ++i) {
            for (; k < kept.size() && (i == entries_.size() || kept[k].first <= entries_[i].key); ++k) put(kept[k].first, kept[k].second->seen, kept[k].second->parts, kept[k].second->value);
            if (i < entries_.size() && found_[i]) put(entries_[i].key, entries_[i].seen, bytes(entries_[i].parts, entries_[i].value), bytes(entries_[i].value, entries_[i].end));
        }
        entries_ = std::move(entries), bytes_ = std::move(bytes_now);
    }
    found_.clear();
    for (Shard& s : shards_) s.kept.clear();
}

double LightMemo::taken_over() const {
    return gather.size() ? static_cast<double>(gather.found()) / static_cast<double>(gather.size()) : 0;
}

} // namespace kiln
