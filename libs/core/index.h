// Typed indices: a FaceId is neither an int nor a SideId.
#pragma once
#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>

namespace kiln {

template <class Tag> struct Index {
    static constexpr bool kRawBytes = true;
    std::uint32_t value = UINT32_MAX; // UINT32_MAX: none
    friend constexpr auto operator<=>(Index, Index) = default;
    constexpr bool valid() const { return value != UINT32_MAX; }
    constexpr std::size_t at() const { return value; }
};
template <class Id> constexpr Id id(std::size_t i) { return Id{static_cast<std::uint32_t>(i)}; }

} // namespace kiln
template <class Tag> struct std::hash<kiln::Index<Tag>> {
    std::size_t operator()(kiln::Index<Tag> i) const noexcept { return i.value * 0x9E3779B97F4A7C15ull; }
};
