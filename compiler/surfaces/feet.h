// Where what casts shadows stands on faces that it does not cut: brush models, light blockers, terrain, patches. CSG makes no
// fragments between them, so a floor runs on under a door; the light of both sides of the door would share its luxels.
#pragma once
#include "compiler/csg/box_tree.h"
#include "compiler/surfaces/curves.h"
#include <memory>

namespace kiln {

class Feet {
public:
    struct Part {
        PlanePolygon polygon;
        std::uint32_t under = 0; // what stands on it, as a number: equal for the same; 0: nothing
    };
    // `planes`: those of csg. `own`: the same table, to which planes of curves are added where they stand on faces; only
    // asked for where there are curves.
    Feet(const World& world, const Csg& csg, const CurveGrids& grids, const PlaneTable& planes, PlaneTable* own);
    bool any() const { return !blockers_.empty(); }
    // The parts of a polygon of a face of `model`, which overlap nowhere and make it up. Exact: none is dropped, however thin.
    // Empty: nothing stands there.
    std::vector<Part> cut(ModelId model, const PlanePolygon& polygon);

private:
    struct Blocker {
        std::uint32_t owner = 0;
        ModelId model;                  // whose faces it does not part: CSG saw to them; none: parts all
        std::vector<PlaneId> planes;    // outwards; of a curve once they are asked for
        std::array<Vec3, 3> corner{};   // a curve's: a triangle
        std::array<std::int64_t, 3> down{};
        Box3 box;                       // holds it
        bool curve = false, asked = false;
    };
    const PlaneTable& planes_;
    PlaneTable* own_;
    std::vector<Blocker> blockers_;
    std::unique_ptr<csg_detail::BoxTree> tree_;
    std::map<std::vector<std::uint32_t>, std::uint32_t> number_of_; // sets of owners, ascending
    std::vector<std::vector<std::uint32_t>> sets_;
    std::vector<std::uint32_t> near_;

    void ask(Blocker& blocker);
    std::uint32_t with(std::uint32_t under, std::uint32_t owner);
};

} // namespace kiln
