// Contents pair by pair: which faces remain and what lies in front of them.
#include "measure.h"
#include "pairs.h"

namespace kiln::test {
namespace {

FaceAreas measured_areas(const Csg& csg, const std::array<BrushId, 2>& ids) {
    FaceAreas areas;
    for (const Fragment& f : csg.fragments) {
        const int self = f.brush == ids[1];
        const Vec3 n = csg.planes.normal(f.polygon.support);
        int face = 0;
        for (int axis = 0; axis < 3; ++axis)
            if (n[static_cast<std::size_t>(axis)] != 0) face = axis * 2 + (n[static_cast<std::size_t>(axis)] > 0);
        Boundary b;
        add(b, csg.planes, f.polygon);
        areas[{self, face, static_cast<int>(f.front)}] += b.area;
    }
    return areas;
}

TEST(CsgPrecedence, EveryOrderedPairInEveryPosition) {
    for (const PairKind& first : kPairKinds)
        for (const PairKind& second : kPairKinds)
            for (const Position position : kPositions) {
                SCOPED_TRACE(std::string(first.name) + " with " + second.name + ", position " + std::to_string(static_cast<int>(position)));
                const FaceAreas expected = expected_areas(first, second, position);
                for (const bool swapped : {false, true}) { // the order in the file makes no difference
                    std::array<BrushId, 2> ids;
                    const Csg csg = compile(pair_world(first, second, position, swapped, {}, &ids));
                    EXPECT_EQ(measured_areas(csg, ids), expected);
                    for (const Fragment& f : csg.fragments) {
                        EXPECT_EQ(f.covered, f.behind == Contents::solid && f.front == Contents::detail);
                        const auto liquid = [](Contents c) { return c == Contents::water || c == Contents::slime || c == Contents::lava; };
                        EXPECT_EQ(f.both_sides, liquid(f.behind) && (f.front == Contents::empty || liquid(f.front)));
                    }
                }
            }
}

// The one thing that depends on order: of equals, a face in the same place and facing the same way is the earlier's.
TEST(CsgPrecedence, OfEqualsTheEarlierHasWhatBothHave) {
    for (const PairKind& kind : kPairKinds) {
        if (kind.rank < 0) continue;
        WorldBuilder w;
        const MaterialId m = w.material(kind.name, kind.flags);
        w.box({0, 0, 0}, {64, 64, 64}, kind.contents, {0}, m);
        w.box({0, 0, 0}, {64, 64, 64}, kind.contents, {0}, m);
        const Csg csg = compile(w.world);
        EXPECT_EQ(csg.fragments.size(), 6u) << kind.name;
        for (const Fragment& f : csg.fragments) EXPECT_EQ(f.brush.value, 0u) << kind.name;
    }
    for (const PairKind& weak : kPairKinds) // and of unequals the stronger's, in whichever order
        for (const PairKind& strong : kPairKinds) {
            if (strong.rank < 0 || weak.rank <= strong.rank) continue;
            for (const bool swapped : {false, true}) {
                WorldBuilder w;
                const PairKind& a = swapped ? strong : weak;
                const PairKind& b = swapped ? weak : strong;
                w.box({0, 0, 0}, {64, 64, 64}, a.contents);
                w.box({0, 0, 0}, {64, 64, 64}, b.contents);
                const Csg csg = compile(w.world);
                EXPECT_EQ(csg.fragments.size(), 6u) << a.name << " " << b.name;
                for (const Fragment& f : csg.fragments) EXPECT_EQ(f.behind, strong.contents) << a.name << " " << b.name;
            }
        }
}

TEST(CsgPrecedence, OccludersJoinWithinTheirEntity) {
    WorldBuilder w;
    const MaterialId nodraw = w.material("nodraw", kNoDraw);
    w.box({-500, 0, 0}, {-400, 64, 64});
    const EntityId one = w.point_entity("func_occluder", {}), two = w.point_entity("func_occluder", {});
    const auto occluder = [&](Vec3 lo, Vec3 hi, EntityId e) {
        const BrushId b = w.box(lo, hi, Contents::occluder);
        w.world.brushes[b.at()].entity = e;
        return b;
    };
    occluder({0, 0, 0}, {64, 64, 64}, one);
    occluder({32, 0, 0}, {96, 64, 64}, one);
    occluder({64, 0, 0}, {128, 64, 64}, two); // takes nothing from the others
    const BrushId thin = occluder({0, 200, 0}, {64, 208, 64}, two);
    for (std::uint32_t s = 0; s < 6; ++s)
        if (s != 3) w.world.sides[w.world.brushes[thin.at()].first_side + s].material = nodraw; // all but one side
    const Csg csg = compile(w.world);
    double area_of[6] = {};
    for (const Fragment& f : csg.fragments) {
        Boundary b;
        add(b, csg.planes, f.polygon);
        area_of[f.brush.at()] += b.area;
        EXPECT_FALSE(f.covered || f.both_sides);
    }
    EXPECT_EQ(area_of[1] + area_of[2], 2 * 64 * 64 + 4 * 96 * 64); // one box of 96 x 64 x 64
    EXPECT_EQ(area_of[3], 6 * 64 * 64);
    EXPECT_EQ(area_of[4], 64 * 64);
}

TEST(CsgEditorVertices, MisreadPlanesAreFound) {
    WorldBuilder w;
    w.box({0, 0, 0}, {64, 64, 64});
    w.box({100, 0, 0}, {164, 64, 64});
    const Csg plain = compile(w.world);
    EXPECT_EQ(plain.report.editor_sides, 0u);
    for (std::size_t b = 0; b < 2; ++b)
        for (std::size_t f = 0; f < 6; ++f)
            w.world.sides[plain.brushes[b].sides[f].at()].editor_vertices = points(plain.planes, plain.brushes[b].faces[f]);
    Context good;
    auto csg = build_csg(w.world, {}, good);
    EXPECT_EQ(csg->report.editor_sides, 12u);
    EXPECT_EQ(csg->report.editor_mismatches, 0u);
    EXPECT_TRUE(good.diagnostics().empty());

    WorldSide& side = w.world.sides[8];
    side.editor_vertices[1] += Vec3{0, 0, 0.1}; // rounded, by an eighth at most: no matter
    Context near;
    csg = build_csg(w.world, {}, near);
    EXPECT_NEAR(csg->report.largest_editor_mismatch, 0.1, 1e-12);
    EXPECT_TRUE(near.diagnostics().empty());

    side.editor_vertices.insert(side.editor_vertices.begin() + 1, (side.editor_vertices[0] + side.editor_vertices[1]) * 0.5); // on an edge: no matter
    side.editor_vertices[3] -= Vec3{0, 0, 7};
    Context wrong;
    csg = build_csg(w.world, {}, wrong);
    EXPECT_EQ(csg->report.editor_mismatches, 1u);
    EXPECT_EQ(csg->report.largest_editor_mismatch_side, id<SideId>(8));
    ASSERT_EQ(wrong.diagnostics().size(), 1u);
    EXPECT_EQ(wrong.diagnostics()[0].code, "editor-vertices-differ");
    EXPECT_EQ(wrong.diagnostics()[0].severity, Severity::note);
    EXPECT_EQ(wrong.diagnostics()[0].where.line, side.line);
}

} // namespace
} // namespace kiln::test
