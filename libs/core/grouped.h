// Numbers by what they belong to, in two vectors instead of one for each.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace kiln {

class Grouped {
public:
    Grouped() = default;
    // each(add) calls add(group, number) for all of them, in the order in which they are to stand in each group; it is asked twice, alike.
    template <class Each> Grouped(std::size_t groups, const Each& each) : first_(groups + 1) {
        each([&](std::size_t group, std::uint32_t) { ++first_[group + 1]; });
        for (std::size_t g = 0; g < groups; ++g) first_[g + 1] += first_[g];
        of_.resize(first_[groups]);
        std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
        each([&](std::size_t group, std::uint32_t number) { of_[next[group]++] = number; });
    }
    std::size_t size() const { return first_.empty() ? 0 : first_.size() - 1; } // groups
    std::span<const std::uint32_t> operator[](std::size_t group) const { return std::span(of_).subspan(first_[group], first_[group + 1] - first_[group]); }

private:
    std::vector<std::uint32_t> first_, of_; // per group, and one more: in of_
};

} // namespace kiln
