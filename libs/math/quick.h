// A colour in floats, all of it at once: where many are added up, most of the time is waiting for memory. Exact to 1e-6 of the largest sum.
#pragma once
#include "libs/math/vec.h"

namespace kiln {

struct QuickLight {
    float __attribute__((vector_size(16))) of{};
    QuickLight() = default;
    explicit QuickLight(Rgbd c) : of{static_cast<float>(c.x), static_cast<float>(c.y), static_cast<float>(c.z), 0} {}
    explicit operator Rgbd() const { return {of[0], of[1], of[2]}; }
    QuickLight& operator+=(const QuickLight& o) {
        of += o.of;
        return *this;
    }
    friend QuickLight operator+(QuickLight a, const QuickLight& b) { return a += b; }
    friend QuickLight operator*(QuickLight a, double by) {
        a.of *= static_cast<float>(by);
        return a;
    }
    friend QuickLight operator*(QuickLight a, Rgbd by) {
        a.of *= QuickLight(by).of;
        return a;
    }
};

} // namespace kiln
