// Where lights may shine, as the visibility rows say: what is known to be dark is asked of no ray. Private to this folder.
#pragma once
#include "compiler/light/emitters.h"
#include "compiler/light/patches.h"
#include "compiler/visibility/visibility.h"

namespace kiln {

// Clusters that hold a place, ascending; none: nothing is known of it, all may shine there.
using Clusters = std::vector<std::uint32_t>;

// Those of several things; none as soon as nothing is known of one.
class Together {
public:
    void add(const Clusters& some) {
        known_ = known_ && !some.empty();
        all_.insert(all_.end(), some.begin(), some.end());
    }
    Clusters clusters();

private:
    Clusters all_;
    bool known_ = true;
};

class LightSight {
public:
    static constexpr double kHair = 1e-3; // map units: as far as the rows were opened for rounding
    // `seen`: rows that know no limit of distance; null: all may shine everywhere. So it is, too, where a brush that seals stops no light, and
    // with what lies outside the box that the tree divides.
    LightSight(const World& world, const Surfaces& surfaces, const Bsp& bsp, const Visibility* seen, const TraceScene& scene, const std::vector<Light>& lights, const EmitterSet& emitters);

    // Within `reach` map units of the hull of some points. Below 0: what reaches over a border by less than that does not count.
    Clusters at(std::span<const Vec3> points, double reach) const;
    Clusters at(Vec3 x) const { return at(std::span(&x, 1), kHair); }
    Clusters of_face(const Surfaces& surfaces, FaceId face) const;
    // Of all luxels of a patch, which may lie on several faces, seen from `off` map units in front of them.
    Clusters of_patch(const Surfaces& surfaces, const PatchTable& table, std::uint32_t patch, double off) const;
    // May its light come to these clusters? No is certain.
    bool light_may(std::uint32_t light, const Clusters& to) const { return may(lights_, light, to); }
    bool emitter_may(std::uint32_t emitter, const Clusters& to) const { return may(emitters_, emitter, to); }
    // visit(light), ascending, of those that reach within `radius` map units of a place there.
    template <class Visit> void each_light(const Clusters& to, Vec3 x, double radius, const Visit& visit) const {
        each(lights_, to, [&](std::uint32_t i) {
            const Vec3 d = reaches_[i].from - x;
            const double far = reaches_[i].far + radius;
            if (dot(d, d) <= far * far) visit(i);
        });
    }
    template <class Visit> void each_emitter(const Clusters& to, const Visit& visit) const { each(emitters_, to, visit); }
    // Likewise of whatever else shines.
    struct Sources { // per cluster a row of bits
        std::uint32_t count = 0;
        std::size_t words = 0;
        std::vector<std::uint64_t> bits;
    };
    Sources sources(std::span<const Clusters> from) const; // one entry a source
    template <class Visit> void each(const Sources& of, const Clusters& to, const Visit& visit) const {
        if (!seen_ || to.empty()) {
            for (std::uint32_t i = 0; i < of.count; ++i) visit(i);
            return;
        }
        for (std::size_t w = 0; w < of.words; ++w) {
            std::uint64_t any = 0;
            for (const std::uint32_t c : to) any |= of.bits[c * of.words + w];
            for (; any; any &= any - 1) visit(static_cast<std::uint32_t>(w * 64) + static_cast<std::uint32_t>(std::countr_zero(any)));
        }
    }

private:
    bool may(const Sources& of, std::uint32_t which, const Clusters& to) const {
        if (!seen_ || to.empty()) return true;
        return std::ranges::any_of(to, [&](std::uint32_t c) { return of.bits[c * of.words + which / 64] >> (which % 64) & 1; });
    }
    Clusters on(const Surfaces& surfaces, FaceId face, Vec2 lo, Vec2 hi, double off) const; // a rectangle of luxels

    const Bsp& bsp_;
    Box3 box_; // beyond it the leaves at its rim have no portals
    const Visibility* seen_ = nullptr;
    Sources lights_, emitters_;
    struct Reach { // of an entity: beyond it there is no light of it
        Vec3 from;
        double far = 1e150; // map units
    };
    std::vector<Reach> reaches_;
};

} // namespace kiln
