// Reading parts of a level, or the fault that says which one could not be read.
#pragma once
#include "formats/level/kiln_level.h"
#include "libs/core/result.h"
#include <span>

namespace kiln {

inline Fault damaged(const char* part, kiln_status status = KILN_DAMAGED) {
    return fault(Exit::input, "level-damaged", std::string("the ") + part + " of the level: " + kiln_status_text(status));
}
template <class T> std::span<const T> part(const kiln_level* level, const T* (*function)(const kiln_level*, size_t*),
                                           std::size_t each = 1) {
    size_t n = 0;
    const T* data = function(level, &n);
    return {data, data ? n * each : 0};
}

} // namespace kiln
