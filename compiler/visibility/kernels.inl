// Included once per instruction set. Everything in here is local to that file: nothing built for a newer processor may be what the linker
// takes for all of them.
#include "compiler/visibility/kernels.h"
#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace kiln::vis {
namespace {

using Four = double __attribute__((vector_size(32)));
using Loose = double __attribute__((vector_size(32), aligned(8), may_alias)); // as it lies in an array
using Mask = long long __attribute__((vector_size(32)));

#define KILN_INLINE inline __attribute__((always_inline))

KILN_INLINE Four load(const double* at) { return *reinterpret_cast<const Loose*>(at); }
KILN_INLINE void store(double* at, const Four& v) { *reinterpret_cast<Loose*>(at) = v; }
KILN_INLINE Four all_of(double v) { return Four{v, v, v, v}; }
KILN_INLINE unsigned bits(const Mask& m) { // of lane k: bit k
#if defined(__AVX2__)
    return static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<__m256d>(m)));
#elif defined(__SSE2__)
    union {
        Mask m;
        __m128d half[2];
    } u = {m};
    return static_cast<unsigned>(_mm_movemask_pd(u.half[0]) | _mm_movemask_pd(u.half[1]) << 2);
#else
    return static_cast<unsigned>((m[0] & 1) | (m[1] & 2) | (m[2] & 4) | (m[3] & 8));
#endif
}
KILN_INLINE Four root(const Four& v) {
#if defined(__AVX2__)
    return reinterpret_cast<Four>(_mm256_sqrt_pd(reinterpret_cast<__m256d>(v)));
#else
    return Four{__builtin_sqrt(v[0]), __builtin_sqrt(v[1]), __builtin_sqrt(v[2]), __builtin_sqrt(v[3])};
#endif
}

KILN_INLINE void pad(double* x, double* y, double* z, std::uint32_t n) {
    for (std::uint32_t i = n; i < padded(n); ++i) x[i] = x[0], y[i] = y[0], z[i] = z[0];
}

Clip clip_kernel(const PointsView& in, const PlanesView& planes, const double* sphere, double open, double noise, PointsOut& a, PointsOut& b) {
    PointsView now = in;
    PointsOut* into = &a;
    PointsOut* other = &b;
    const Four cx = all_of(sphere[0]), cy = all_of(sphere[1]), cz = all_of(sphere[2]), radius = all_of(sphere[3]), over = all_of(noise), under = all_of(-open);
    for (std::uint32_t k = 0; k < planes.n; k += 4) {
        const Four at = load(planes.x + k) * cx + load(planes.y + k) * cy + load(planes.z + k) * cz - load(planes.d + k);
        for (unsigned todo = ~bits(at > radius) & 15u; todo; todo &= todo - 1) {
            const std::uint32_t i = k + static_cast<std::uint32_t>(__builtin_ctz(todo));
            if (i >= planes.n) break;
            if (into->room < 2 * now.n + 4) return Clip::no_room;
            const double nx = planes.x[i], ny = planes.y[i], nz = planes.z[i], nd = planes.d[i];
            const Four px = all_of(nx), py = all_of(ny), pz = all_of(nz), pd = all_of(nd);
            unsigned front = 0, cut = 0;
            for (std::uint32_t j = 0; j < now.n; j += 4) {
                const Four d = px * load(now.x + j) + py * load(now.y + j) + pz * load(now.z + j) - pd;
                front |= bits(d > over), cut |= bits(d < under);
            }
            if (!front) return Clip::nothing;
            if (!cut) continue;
            std::uint32_t m = 0;
            double ax = now.x[now.n - 1], ay = now.y[now.n - 1], az = now.z[now.n - 1];
            double da = (nx * ax + ny * ay + nz * az - nd) + open;
            for (std::uint32_t j = 0; j < now.n; ++j) {
                const double bx = now.x[j], by = now.y[j], bz = now.z[j];
                const double db = (nx * bx + ny * by + nz * bz - nd) + open;
                if ((da < 0) != (db < 0)) {
                    const double t = da / (da - db);
                    into->x[m] = ax + (bx - ax) * t, into->y[m] = ay + (by - ay) * t, into->z[m] = az + (bz - az) * t;
                    ++m;
                }
                if (db >= 0) into->x[m] = bx, into->y[m] = by, into->z[m] = bz, ++m;
                ax = bx, ay = by, az = bz, da = db;
            }
            pad(into->x, into->y, into->z, m);
            into->n = m;
            now = {into->x, into->y, into->z, m};
            PointsOut* const turn = into;
            into = other, other = turn;
        }
    }
    if (now.x == in.x) return Clip::whole;
    if (now.x != a.x) { // the caller finds it in `a`
        const PointsOut turn = a;
        a = b, b = turn;
    }
    return Clip::cut;
}

// Four edges of `a` side by side. Seen along an edge, a plane through it is a line that turns round the edge's point away from `a`
// until all of b is in front: it stops at the point whose direction is nearest to that of `a`, the one with the largest cotangent.
void separators_kernel(const PointsView& a, const PointsView& b, const double* normals, bool flipped, double noise, double error, double inside, PlanesOut& out) {
    double mx = 0, my = 0, mz = 0;
    for (std::uint32_t i = 0; i < a.n; ++i) mx += a.x[i], my += a.y[i], mz += a.z[i];
    const double part = 1.0 / static_cast<double>(a.n);
    const Four ix = all_of(mx * part), iy = all_of(my * part), iz = all_of(mz * part), zero = all_of(0), one = all_of(1);
    const Four ux = all_of(normals[0]), uy = all_of(normals[1]), uz = all_of(normals[2]), vx = all_of(normals[3]), vy = all_of(normals[4]), vz = all_of(normals[5]);
    for (std::uint32_t k = 0; k < a.n; k += 4) {
        const Four px = load(a.x + k), py = load(a.y + k), pz = load(a.z + k);
        Four qx, qy, qz; // the points after them
        for (std::uint32_t l = 0; l < 4; ++l) {
            const std::uint32_t next = k + l + 1 < a.n ? k + l + 1 : 0;
            qx[l] = a.x[next], qy[l] = a.y[next], qz[l] = a.z[next];
        }
        const Four ex = qx - px, ey = qy - py, ez = qz - pz;
        const Four rx = ix - px, ry = iy - py, rz = iz - pz;
        const Four tx = ry * ez - rz * ey, ty = rz * ex - rx * ez, tz = rx * ey - ry * ex; // n = cross(edge, v - p) has the middle of a behind if t * (v - p) < 0
        const Four sx = ey * tz - ez * ty, sy = ez * tx - ex * tz, sz = ex * ty - ey * tx; // across the edge, into a
        Four best = all_of(-__builtin_huge_val()), wx = zero, wy = zero, wz = zero, side = zero;
        for (std::uint32_t j = 0; j < b.n; ++j) {
            const Four dx = all_of(b.x[j]) - px, dy = all_of(b.y[j]) - py, dz = all_of(b.z[j]) - pz;
            const Four up = tx * dx + ty * dy + tz * dz, along = sx * dx + sy * dy + sz * dz;
            const Four size = up < zero ? -up : up;
            const Four cotangent = along / size;
            const Mask better = cotangent > best;
            best = better ? cotangent : best, side = better ? up : side;
            wx = better ? dx : wx, wy = better ? dy : wy, wz = better ? dz : wz;
        }
        Four nx = ey * wz - ez * wy, ny = ez * wx - ex * wz, nz = ex * wy - ey * wx;
        const Four size2 = nx * nx + ny * ny + nz * nz;
        Mask good = size2 > zero;
        const Four scale = (side > zero ? -one : one) / root(good ? size2 : one);
        nx *= scale, ny *= scale, nz *= scale;
        Four most = all_of(-__builtin_huge_val()), least = all_of(__builtin_huge_val()); // of a, of b along n
        for (std::uint32_t j = 0; j < a.n; ++j) {
            const Four d = nx * all_of(a.x[j]) + ny * all_of(a.y[j]) + nz * all_of(a.z[j]);
            most = d > most ? d : most;
        }
        for (std::uint32_t j = 0; j < b.n; ++j) {
            const Four d = nx * all_of(b.x[j]) + ny * all_of(b.y[j]) + nz * all_of(b.z[j]);
            least = d < least ? d : least;
        }
        // Sines between the plane and those of a and b: so much of a step within a polygon goes along n.
        const Four ca = nx * ux + ny * uy + nz * uz, cb = nx * vx + ny * vy + nz * vz;
        const Four sa2 = one - ca * ca, sb2 = one - cb * cb;
        const Four sa = root(sa2 > zero ? sa2 : zero), sb = root(sb2 > zero ? sb2 : zero);
        good &= most - least + all_of(2 * error) <= all_of(inside) * (sa + sb);
        // The far side of the passage is the one that is looked through.
        const Four through = flipped ? sa : sb;
        Four lack = all_of(noise + 2 * error) - all_of(inside) * through;
        lack = lack > zero ? lack : zero;
        const Four d = flipped ? -most - lack : least - lack;
        if (flipped) nx = -nx, ny = -ny, nz = -nz;
        for (unsigned todo = bits(good); todo; todo &= todo - 1) {
            const auto l = static_cast<std::uint32_t>(__builtin_ctz(todo));
            if (k + l >= a.n) break;
            out.x[out.n] = nx[l], out.y[out.n] = ny[l], out.z[out.n] = nz[l], out.d[out.n] = d[l];
            ++out.n;
        }
    }
    for (std::uint32_t i = out.n; i < padded(out.n); ++i) out.x[i] = out.y[i] = out.z[i] = 0, out.d[i] = -__builtin_huge_val();
}

bool hidden_kernel(const PointsView& points, const double* sphere, const PlanesView& planes, double noise) {
    const Four cx = all_of(sphere[0]), cy = all_of(sphere[1]), cz = all_of(sphere[2]), behind = all_of(-sphere[3]), over = all_of(noise);
    for (std::uint32_t k = 0; k < planes.n; k += 4) {
        const Four nx = load(planes.x + k), ny = load(planes.y + k), nz = load(planes.z + k), nd = load(planes.d + k);
        const Four at = nx * cx + ny * cy + nz * cz - nd;
        if (bits(at < behind)) return true;
        Mask front = at > over;
        for (std::uint32_t j = 0; bits(front) != 15u; ++j) {
            if (j == points.n) return true;
            front |= nx * all_of(points.x[j]) + ny * all_of(points.y[j]) + nz * all_of(points.z[j]) - nd > over;
        }
    }
    return false;
}

void sides_kernel(const double* plane, const double* const* groups, const double* const* spheres, const PointsView* points, std::size_t count, double noise, std::uint64_t* front, std::uint64_t* back) {
    const Four nx = all_of(plane[0]), ny = all_of(plane[1]), nz = all_of(plane[2]), nd = all_of(plane[3]), over = all_of(noise), under = all_of(-noise);
    for (std::size_t word = 0; word * 64 < count; ++word) {
        std::uint64_t f = 0, b = 0;
        // All of them far on one side: what each would say, and more than rounding away from saying anything else.
        const double middle = plane[0] * groups[0][word] + plane[1] * groups[1][word] + plane[2] * groups[2][word] - plane[3], beyond = groups[3][word] + 4 * noise;
        if (__builtin_fabs(middle) > beyond) (middle > 0 ? f : b) = ~std::uint64_t{0};
        else for (std::size_t k = word * 64; k < word * 64 + 64 && k < count; k += 4) {
            const Four at = nx * load(spheres[0] + k) + ny * load(spheres[1] + k) + nz * load(spheres[2] + k) - nd, radius = load(spheres[3] + k);
            unsigned is_front = bits(at > over), is_back = bits(at < under);
            // Not so by its centre, and near enough to the plane to be so by a point.
            const unsigned may_front = ~is_front & bits(at >= -radius), may_back = ~is_back & bits(at <= radius);
            for (unsigned todo = may_front | may_back; todo; todo &= todo - 1) {
                const auto l = static_cast<unsigned>(__builtin_ctz(todo));
                if (k + l >= count) break;
                const PointsView& p = points[k + l];
                unsigned any_front = 0, any_back = 0;
                for (std::uint32_t j = 0; j < p.n; j += 4) {
                    const Four d = nx * load(p.x + j) + ny * load(p.y + j) + nz * load(p.z + j) - nd;
                    any_front |= bits(d > over), any_back |= bits(d < under);
                }
                if (any_front) is_front |= may_front & (1u << l);
                if (any_back) is_back |= may_back & (1u << l);
            }
            f |= static_cast<std::uint64_t>(is_front) << (k % 64), b |= static_cast<std::uint64_t>(is_back) << (k % 64);
        }
        if (count - word * 64 < 64) { // the padding is no polygon
            const std::uint64_t real = (std::uint64_t{1} << (count - word * 64)) - 1;
            f &= real, b &= real;
        }
        front[word] = f, back[word] = b;
    }
}

constexpr Kernels kKernels{clip_kernel, separators_kernel, hidden_kernel, sides_kernel};

} // namespace
} // namespace kiln::vis
