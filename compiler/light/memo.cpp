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

void StepMemo::begin(std::size_t items) {
    was_ = std::move(now_);
    if (was_.size() != items) was_.clear();
    now_.clear(), now_.resize(items);
}

const Bytes* StepMemo::find(std::size_t item, std::uint64_t key, const std::vector<std::uint64_t>& states) {
    if (was_.empty()) return nullptr;
    for (Entry& e : was_[item]) {
        std::uint64_t seen = 0;
        if (e.key != key || !seen_of(e.parts, states, &seen) || seen != e.seen) continue;
        now_[item].push_back(e);
        now_[item].back().found = true;
        return &now_[item].back().value;
    }
    return nullptr;
}

void StepMemo::keep(std::size_t item, std::uint64_t key, const std::vector<std::uint64_t>& states, const std::vector<std::uint32_t>& parts, Bytes value) {
    Entry e{key, 0, packed(parts), std::move(value)};
    if (seen_of(e.parts, states, &e.seen)) now_[item].push_back(std::move(e));
}

std::array<std::size_t, 2> StepMemo::taken_over() const {
    std::array<std::size_t, 2> out{};
    for (const auto& entries : now_)
        for (const Entry& e : entries) out[0] += e.found, ++out[1];
    return out;
}

double LightMemo::taken_over() const {
    std::array<std::size_t, 2> sum{};
    for (const PatchMemo& t : tables) {
        const auto [found, all] = t.gather.taken_over();
        sum[0] += found, sum[1] += all;
    }
    return sum[1] ? static_cast<double>(sum[0]) / static_cast<double>(sum[1]) : 0;
}

} // namespace kiln
