// Patches: the elements on which all bounces are solved. A patch is a set of luxel pieces of one chart (on a curve they
// lie in several planes): those of one material that lie in one power-of-two block of luxels and hang together along edges. A wall that stands on a
// floor cuts the pieces, so nothing spreads under it. Faces without a chart are one patch each.
#pragma once
#include "compiler/light/light.h"
#include "libs/core/grouped.h"
#include "libs/sampling/sobol.h"
#include <array>
#include <span>

namespace kiln {

double polygon_area(const PiecePoints& points);

constexpr std::uint32_t kNoPatch = UINT32_MAX;
constexpr std::uint32_t kMixedPatch = UINT32_MAX - 1; // a texel whose pieces belong to several patches

struct PatchTable {
    std::vector<Patch> patches;
    std::vector<std::uint32_t> texel_patch;         // per texel; kNoPatch, kMixedPatch
    std::vector<std::uint32_t> piece_patch;         // per piece
    std::vector<std::uint32_t> face_patch;          // per face without chart; else kNoPatch
    std::vector<std::uint32_t> first_piece, pieces; // per patch: its pieces (none for faces without chart)
    template <class A> void fields(A& a) { a(patches, texel_patch, piece_patch, face_patch, first_piece, pieces); }
};

// Pieces that touch along an edge: (a, b), a < b, within one chart; sorted.
using PieceEdges = std::vector<std::array<std::uint32_t, 2>>;
PieceEdges piece_adjacency(const Surfaces& surfaces);

// `h`: wanted patch size, map units.
PatchTable build_patches(const World& world, const Surfaces& surfaces, const PieceEdges& edges, double h);

// Per luxel the patch of the larger part of it; kNoPatch: it has no pieces. `piece_patch`: of PatchTable.
std::vector<std::uint32_t> patches_of_luxels(const Surfaces& surfaces, std::span<const std::uint32_t> piece_patch);

// Where the luxels beside one lie.
inline constexpr std::array<std::array<int, 2>, 4> kBeside{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
// Per luxel, a bit for each of these that goes on from it: some piece of theirs shares an edge with one of its own. Of a luxel that a wall cuts, only its larger part counts.
std::vector<std::uint8_t> luxels_beside(const Surfaces& surfaces, const PieceEdges& edges, std::span<const std::uint32_t> piece_patch, std::span<const std::uint32_t> luxel_patch);

// Patches that share an edge in one plane: each pair once, ascending.
using TouchingPatches = std::vector<std::array<std::uint32_t, 2>>;
TouchingPatches touching_patches(const PieceEdges& edges, const PatchTable& table);
Grouped neighbours_of(const TouchingPatches& touching, std::size_t patches); // of each patch, ascending

// Values of patches (means over them) at their luxels: linear over each patch, with the slope that its neighbours along edges show. At
// most as far off the mean as the neighbour that differs most, and nowhere below 0. `luxels`: of each patch; others: 0. `neighbours`: neighbours_of(touching_patches).
std::vector<Rgbd> values_at_luxels(const Surfaces& surfaces, const Grouped& neighbours, const Grouped& luxels, const std::vector<Rgbd>& values, Context& context);

// Where luxels lie: texel -> luxel, hit -> patch.
class LuxelIndex {
public:
    explicit LuxelIndex(const Surfaces& surfaces);
    // Texel (index over all charts) of a point on a face, clamped into its chart; UINT32_MAX: it has none.
    std::uint32_t texel_at(FaceId face, Vec3 point) const {
        const Lattice& lattice = lattice_[face.at()];
        if (lattice.first_texel == UINT32_MAX) return UINT32_MAX;
        const Vec3 d = point - lattice.origin;
        const double x = std::clamp(dot(d, lattice.s) / lattice.unit, 0.0, lattice.width - 1.0), y = std::clamp(dot(d, lattice.t) / lattice.unit, 0.0, lattice.height - 1.0);
        return lattice.first_texel + static_cast<std::uint32_t>(y) * lattice.width + static_cast<std::uint32_t>(x);
    }
    double luxel_size(FaceId face) const { return lattice_[face.at()].luxel_size; } // map units; of a face with a chart
    std::uint32_t luxel_of(std::uint32_t texel) const { return texel_luxel_[texel]; } // UINT32_MAX: none
    // The piece of `face` nearest to a point, looked for in the point's texel and the eight around it.
    std::uint32_t piece_at(FaceId face, Vec3 point) const;

private:
    struct Lattice { // of a face, what its chart says of it: those lie too far apart in memory to be asked ray by ray
        Vec3 origin, s, t;
        double unit = 1, luxel_size = 0; // along s and t
        std::uint32_t first_texel = UINT32_MAX, width = 0, height = 0;
    };
    const Surfaces& surfaces_;
    std::vector<Lattice> lattice_;
    std::vector<std::uint32_t> texel_luxel_;
};

// Hit -> patch, from the tables kept in Lighting.
std::uint32_t patch_at(const LuxelIndex& index, std::span<const std::uint32_t> texel_patch, std::span<const std::uint32_t> piece_patch,
                       std::span<const std::uint32_t> face_patch, FaceId face, Vec3 point);

// Uniform points on a union of pieces or triangles; all lie inside by a margin, so that neither rounding nor the
// push off the surface can carry one into a wall at its rim, even one that leans over it.
class Footprint {
public:
    explicit Footprint(double margin = 0) : margin_(margin) {} // map units
    void add_piece(const Surfaces& surfaces, const LuxelPiece& piece);
    void add_triangle(Vec3 a, Vec3 b, Vec3 c, Vec3 normal);
    bool empty() const { return cells_.empty(); }
    double area() const { return cells_.empty() ? 0 : cells_.back().cumulative; } // map units squared
    Vec3 centroid() const; // of a bent one: off the surface
    struct Point {
        Vec3 position, normal; // geometric
    };
    Point sample(Vec2 u) const {
        if (!whole_square()) return sample_cells(u);
        const Cell& c = cells_[0];
        return {c.corner + c.u * u.x + c.v * u.y, c.normal};
    }
    bool whole_square() const { return cells_.size() == 1 && cells_[0].parallelogram; }
    bool bent() const { return bent_; } // several planes
    Vec3 normal() const { return cells_.empty() ? Vec3{} : cells_[0].normal; } // of its first cell

private:
    struct Cell {
        Vec3 corner, u, v, normal;
        double cumulative = 0;
        bool parallelogram = false;
    };
    Point sample_cells(Vec2 u) const;
    void add(Vec3 corner, Vec3 u, Vec3 v, Vec3 normal, bool parallelogram);
    double margin_ = 0;
    bool bent_ = false;
    std::vector<Cell> cells_;
};

} // namespace kiln
