#include "compiler/light/memo.h"

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
bool seen_of(const Bytes& parts, const std::vector<std::uint64_t>& states, std::uint64_t* seen) {
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

void Memo::begin() {
    for (Shard& s : shards_) s.was = std::move(s.now), s.now.clear();
}
void Memo::end() {
    for (Shard& s : shards_) s.was.clear();
}

const Bytes* Memo::find(std::uint64_t key, const std::vector<std::uint64_t>& states) {
    Shard& s = shard(key);
    const std::lock_guard lock(s.mutex);
    std::uint64_t seen = 0;
    if (const auto again = s.now.find(key); again != s.now.end())
        return seen_of(again->second.parts, states, &seen) && seen == again->second.seen ? &again->second.value : nullptr;
    const auto at = s.was.find(key);
    if (at == s.was.end() || !seen_of(at->second.parts, states, &seen) || seen != at->second.seen) return nullptr;
    Entry& e = s.now.emplace(key, std::move(at->second)).first->second;
    s.was.erase(at);
    e.found = true;
    return &e.value;
}

void Memo::keep(std::uint64_t key, const std::vector<std::uint64_t>& states, const std::vector<std::uint32_t>& parts, Bytes value) {
    Entry e{0, packed(parts), std::move(value)};
    if (!seen_of(e.parts, states, &e.seen)) return;
    Shard& s = shard(key);
    const std::lock_guard lock(s.mutex);
    s.now.insert_or_assign(key, std::move(e));
}

std::size_t Memo::found() const {
    std::size_t n = 0;
    for (const Shard& s : shards_)
        for (const auto& [key, e] : s.now) n += e.found;
    return n;
}
std::size_t Memo::size() const {
    std::size_t n = 0;
    for (const Shard& s : shards_) n += s.now.size();
    return n;
}

double LightMemo::taken_over() const {
    return gather.size() ? static_cast<double>(gather.found()) / static_cast<double>(gather.size()) : 0;
}

} // namespace kiln
