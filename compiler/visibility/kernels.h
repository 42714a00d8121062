// The arithmetic of the flow on short arrays, four numbers at a time, for the processor at hand: the same bits on each of
// them (no fused operations, every lane does what a scalar would). Private to compiler/visibility.
#pragma once
#include <cstddef>
#include <cstdint>

namespace kiln::vis {

// A polygon or a row of planes as arrays of their coordinates, each padded to a multiple of four.
struct PointsView {
    const double *x = nullptr, *y = nullptr, *z = nullptr;
    std::uint32_t n = 0; // those after the last repeat the first
};
struct PlanesView {
    const double *x = nullptr, *y = nullptr, *z = nullptr, *d = nullptr;
    std::uint32_t n = 0; // those after the last have everything in front
};
struct PointsOut {
    double *x = nullptr, *y = nullptr, *z = nullptr;
    std::uint32_t room = 0, n = 0;
};
struct PlanesOut {
    double *x = nullptr, *y = nullptr, *z = nullptr, *d = nullptr;
    std::uint32_t n = 0; // room: for one an edge more, rounded up to fours, and four
};

constexpr std::uint32_t padded(std::uint32_t n) { return (n + 3u) & ~3u; }

enum class Clip : int { nothing, whole, cut, no_room };

struct Kernels {
    // What of `in` is in front of all planes, with the strip of `open` behind each. A plane which the sphere (x, y, z, radius) around
    // all of `in` is in front of is passed over. Nothing: for one plane no point lies in front of it by more than `noise`.
    // Cut: it is in `a`; `b` is scratch.
    Clip (*clip)(const PointsView& in, const PlanesView& planes, const double* sphere, double open, double noise, PointsOut& a, PointsOut& b);
    // Appends planes through an edge of `a` and a point of `b`, `a` behind and `b` in front. See flow.h for what is taken of them;
    // `normals`: unit normals of a and b, six numbers (none: three zeros).
    void (*separators)(const PointsView& a, const PointsView& b, const double* normals, bool flipped, double noise, double error, double inside, PlanesOut& out);
    // Is no point of a polygon (with a sphere around it) by more than `noise` in front of one of the planes?
    bool (*hidden)(const PointsView& points, const double* sphere, const PlanesView& planes, double noise);
    // Bit k of `front`, `back`: some point of polygon k lies by more than `noise` in front of the plane, behind it. `spheres`: x, y, z and
    // radius, four arrays of so many, padded; `groups`: the same around each 64 of them; words of 64.
    void (*sides)(const double* plane, const double* const* groups, const double* const* spheres, const PointsView* points, std::size_t count, double noise, std::uint64_t* front, std::uint64_t* back);
};
const Kernels& kernels(); // the best for this processor
const Kernels& plain_kernels();
#if defined(__x86_64__)
const Kernels& avx2_kernels();
#endif

} // namespace kiln::vis
