#pragma once
#include <algorithm>
#include <vector>

namespace kiln {

// What there is, each once, ascending.
template <class T> std::vector<T> each_once(std::vector<T> values) {
    std::ranges::sort(values);
    const auto again = std::ranges::unique(values);
    values.erase(again.begin(), again.end());
    return values;
}

} // namespace kiln
