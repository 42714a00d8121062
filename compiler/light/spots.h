// What is small and bright from where it is seen: a lit wall at the far end of a view. Too few rays of a row meet it to tell a guide of it, and it is but a part of a
// guide's cell. So it is looked for by what it sends, in trees over all patches. Private to this folder.
#pragma once
#include "compiler/light/light.h"
#include <span>
#include <vector>

namespace kiln {

struct Spot { // the ball around some patches
    Vec3 center;
    double radius = 0;       // map units
    double share = 0;        // of the irradiance of who sees it, were nothing between; rounded
    std::uint32_t patch = 0; // the brightest of them
    template <class A> void fields(A& a) { a(center, radius, share); } // all that guides have of it
};

class SpotTrees {
public:
    SpotTrees() = default;
    // `place`: of each patch; those of one place have a tree of their own.
    SpotTrees(std::span<const Patch> patches, std::span<const Vec3> normals, std::span<const std::uint32_t> place);
    // `radiance`: of each patch.
    void shine(std::span<const double> radiance);

    std::size_t trees() const { return roots_.size(); }
    std::span<const std::uint32_t> tree(std::size_t t) const { return patches_of(roots_[t]); }
    // Patches of one place that lie together, each in one group: what may be a spot for one of them is looked for once.
    std::size_t groups() const { return groups_.size(); }
    std::span<const std::uint32_t> group(std::size_t g) const { return patches_of(groups_[g]); }
    // `trees`: to look in. `least_irradiance`: of the patches of the group, above 0. Out: nodes, for find().
    void may_be_spots(std::size_t group, std::span<const std::uint32_t> trees, double least_irradiance, std::vector<std::uint32_t>& out) const;
    // Spots above the horizon of a place of a patch of that group, with its irradiance; strongest first.
    void find(std::span<const std::uint32_t> may, Vec3 point, Vec3 normal, double irradiance, std::vector<Spot>& out) const;

private:
    // The first child of a node comes next.
    struct Node {
        Vec3f center;
        float radius = 0;
        std::uint32_t first = 0, count = 0; // into order_
        std::uint32_t second = 0;           // child; 0: a leaf
    };
    struct Sum { // of the light that leaves its patches
        Vec3f along;    // radiance, area and normal, added up
        float flux = 0; // radiance and area
        float most = 0; // radiance
        std::uint32_t brightest = 0;
    };
    struct View;
    std::span<const std::uint32_t> patches_of(std::uint32_t node) const { return std::span(order_).subspan(nodes_[node].first, nodes_[node].count); }
    void walk(std::span<const std::uint32_t> from, const View& view, const auto& small) const;
    std::uint32_t build(std::span<std::uint32_t> part, std::span<const Patch> patches, std::span<const Vec3> normals, double scale);
    std::vector<std::uint32_t> order_;
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> roots_, groups_; // nodes
    std::vector<float> area_;           // per node
    std::vector<Vec3f> facing_;         // per patch: normal, as long as its area
    std::vector<Sum> sums_;             // per node
};

} // namespace kiln
