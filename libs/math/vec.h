// Small vectors. Geometry is double in map units; light is float, linear RGB.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace kiln {

template <class T> struct Vec2T {
    static constexpr bool kRawBytes = true;
    T x = 0, y = 0;
    friend constexpr Vec2T operator+(Vec2T a, Vec2T b) { return {a.x + b.x, a.y + b.y}; }
    friend constexpr Vec2T operator-(Vec2T a, Vec2T b) { return {a.x - b.x, a.y - b.y}; }
    friend constexpr Vec2T operator*(Vec2T a, T s) { return {a.x * s, a.y * s}; }
    friend constexpr Vec2T operator*(T s, Vec2T a) { return a * s; }
    friend constexpr bool operator==(const Vec2T&, const Vec2T&) = default;
};
template <class T> constexpr T dot(Vec2T<T> a, Vec2T<T> b) { return a.x * b.x + a.y * b.y; }
template <class T> constexpr T cross(Vec2T<T> a, Vec2T<T> b) { return a.x * b.y - a.y * b.x; }

template <class T> struct Vec3T {
    static constexpr bool kRawBytes = true;
    T x = 0, y = 0, z = 0;
    constexpr T& operator[](std::size_t i) { return i == 0 ? x : i == 1 ? y : z; }
    constexpr const T& operator[](std::size_t i) const { return i == 0 ? x : i == 1 ? y : z; }
    friend constexpr Vec3T operator+(Vec3T a, Vec3T b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
    friend constexpr Vec3T operator-(Vec3T a, Vec3T b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
    friend constexpr Vec3T operator-(Vec3T a) { return {-a.x, -a.y, -a.z}; }
    friend constexpr Vec3T operator*(Vec3T a, T s) { return {a.x * s, a.y * s, a.z * s}; }
    friend constexpr Vec3T operator*(T s, Vec3T a) { return a * s; }
    friend constexpr Vec3T operator*(Vec3T a, Vec3T b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; } // per channel
    friend constexpr Vec3T operator/(Vec3T a, T s) { return {a.x / s, a.y / s, a.z / s}; }
    constexpr Vec3T& operator+=(Vec3T b) { return *this = *this + b; }
    constexpr Vec3T& operator-=(Vec3T b) { return *this = *this - b; }
    constexpr Vec3T& operator*=(T s) { return *this = *this * s; }
    friend constexpr bool operator==(const Vec3T&, const Vec3T&) = default;
    template <class U> constexpr explicit operator Vec3T<U>() const {
        return {static_cast<U>(x), static_cast<U>(y), static_cast<U>(z)};
    }
};
template <class T> constexpr T dot(Vec3T<T> a, Vec3T<T> b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class T> constexpr Vec3T<T> cross(Vec3T<T> a, Vec3T<T> b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T> T length(Vec3T<T> a) { return std::sqrt(dot(a, a)); }
template <class T> Vec3T<T> normalize(Vec3T<T> a) {
    const T l = length(a);
    return l > 0 ? a / l : a;
}
template <class T> constexpr T mean(Vec3T<T> a) { return (a.x + a.y + a.z) / T(3); }
template <class T> constexpr T max_component(Vec3T<T> a) { return std::max(a.x, std::max(a.y, a.z)); }

using Vec2 = Vec2T<double>;
using Vec3 = Vec3T<double>; // points and directions, map units
using Vec3f = Vec3T<float>;
using Rgb = Vec3T<float>;   // linear RGB: radiance, irradiance, radiosity, reflectance as the name says
using Rgbd = Vec3T<double>; // the same while summing

// Axis-aligned box; the default one is empty.
struct Box3 {
    static constexpr bool kRawBytes = true;
    Vec3 lo{1e30, 1e30, 1e30}, hi{-1e30, -1e30, -1e30};
    void add(Vec3 p) {
        for (std::size_t i = 0; i < 3; ++i) lo[i] = std::min(lo[i], p[i]), hi[i] = std::max(hi[i], p[i]);
    }
    void add(const Box3& b) { add(b.lo), add(b.hi); }
    bool empty() const { return lo.x > hi.x; }
    Vec3 center() const { return (lo + hi) * 0.5; }
    Vec3 size() const { return hi - lo; }
    friend bool operator==(const Box3&, const Box3&) = default;
};
inline bool overlap(const Box3& a, const Box3& b) { // touching counts
    for (std::size_t i = 0; i < 3; ++i)
        if (a.lo[i] > b.hi[i] || b.lo[i] > a.hi[i]) return false;
    return true;
}

// A right-handed orthonormal frame unless `b` was mirrored on purpose: directions (t,b,n) in world space.
struct Frame {
    static constexpr bool kRawBytes = true;
    Vec3 t{1, 0, 0}, b{0, 1, 0}, n{0, 0, 1};
    Vec3 world(Vec3 local) const { return t * local.x + b * local.y + n * local.z; }
    Vec3 local(Vec3 w) const { return {dot(w, t), dot(w, b), dot(w, n)}; }
};
// Some frame around a unit normal; continuous except at n = -z (Duff et al. 2017).
inline Frame frame_around(Vec3 n) {
    const double sign = std::copysign(1.0, n.z), a = -1.0 / (sign + n.z), c = n.x * n.y * a;
    return {{1.0 + sign * n.x * n.x * a, sign * c, -sign * n.x}, {c, sign + n.y * n.y * a, -n.y}, n};
}

} // namespace kiln
