// One thing broken at a time, and the check that is about it says so; whole maps pass.
#include "compiler/verify/verify.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include "libs/core/check.h"
#include "libs/core/file.h"
#include "tests/support/world_builder.h"
#include <filesystem>
#include <functional>
#include <gtest/gtest.h>
#include <set>

namespace kiln {
namespace {

struct Made {
    World world;
    Csg csg;
    Bsp bsp;
    Surfaces surfaces;
    Visibility visibility;
};

Made make(World world, bool fill = true) {
    Made m;
    m.world = std::move(world);
    Context context;
    m.csg = *build_csg(m.world, {}, context);
    BspOptions options;
    options.fill = fill;
    m.bsp = *build_bsp(m.world, m.csg, options, context);
    m.surfaces = *build_surfaces(m.world, m.csg, m.bsp, {}, context);
    m.visibility = *compute_visibility(vis_portals(m.bsp), m.bsp.cluster_count, {}, context);
    return m;
}

// Two rooms with a door and a wedge, water on the floor, a detail pillar, an area portal in the door, a brush model.
Made two_rooms() {
    test::WorldBuilder b;
    b.room({0, 0, 0}, {512, 256, 128});
    b.box({250, 0, 0}, {262, 100, 128}), b.box({250, 156, 0}, {262, 256, 128}), b.box({250, 100, 96}, {262, 156, 128});
    b.box({254, 100, 0}, {258, 156, 96}, Contents::area_portal);
    b.box({0, 0, 0}, {250, 256, 24}, Contents::water);
    b.box({380, 100, 0}, {400, 120, 128}, Contents::detail);
    b.box({240, 20, 0}, {256, 60, 40}); // reaches into the wall
    const Vec2 wedge[] = {{300, 20}, {348, 37}, {301, 90}};
    b.prism(wedge, 0, 70);
    const ModelId door = b.model("func_door");
    b.box({420, 30, 8}, {460, 60, 90}, Contents::solid, door);
    b.point_entity("info_player_start", {450, 200, 40});
    return make(b.world);
}

std::string text_of(const Checker& checker) {
    std::string text;
    for (const Check& c : checker.checks())
        for (const Finding& f : c.findings) text += c.code + ": " + f.message + "\n";
    return text;
}
const Check* find(const Checker& checker, std::string_view code) {
    for (const Check& c : checker.checks())
        if (c.code == code) return &c;
    return nullptr;
}
void verify_all(const Made& m, Checker& checker, bool fill = true) {
    const VerifyOptions options{.points = 4000, .seed = 1};
    verify_world(m.world, checker);
    verify_csg(m.world, m.csg, options, checker);
    verify_bsp(m.world, m.csg, m.bsp, fill, options, checker);
    verify_surfaces(m.world, m.csg, m.bsp, m.surfaces, options, checker);
    verify_visibility(m.world, m.bsp, m.visibility, options, checker);
}

TEST(Verify, ACleanWorldPassesEveryCheckAndEveryCheckLooksAtSomething) {
    const Made m = two_rooms();
    Checker checker = Checker::collecting(5);
    verify_all(m, checker);
    EXPECT_EQ(checker.failures(), 0u) << text_of(checker);
    const std::set<std::string> kNotHere = {"closed-gaps", "inside-closed", "world-displacements", "world-patches", "curve-luxels", "curves-seen", "occluders"};
    for (const Check& c : checker.checks())
        EXPECT_EQ(c.checked > 0, !kNotHere.contains(c.code)) << c.code;
}

TEST(Verify, AWorldThatLeaksPassesToo) {
    test::WorldBuilder b;
    b.room({0, 0, 0}, {256, 256, 128});
    b.world.brushes.pop_back();
    b.world.sides.resize(b.world.brushes.back().first_side + b.world.brushes.back().side_count);
    const Made m = make(b.world, false);
    Checker checker = Checker::collecting(5);
    verify_all(m, checker, false);
    EXPECT_EQ(checker.failures(), 0u) << text_of(checker);
}

TEST(Verify, AMicroGapThatWasClosedPasses) {
    test::WorldBuilder b;
    b.box({-16, -16, -16}, {272, 272, 0}), b.box({-16, -16, 128}, {272, 272, 144});
    b.box({-16, 0, 0}, {0, 256, 128}), b.box({256, 0, 0}, {272, 256, 127.9}); // the gap is 0.1 high
    b.box({-16, -16, 0}, {272, 0, 128}), b.box({-16, 256, 0}, {272, 272, 128});
    b.point_entity("info_player_start", {100, 100, 40});
    const Made m = make(b.world);
    ASSERT_FALSE(m.bsp.closed.empty());
    Checker checker = Checker::collecting(5);
    verify_all(m, checker);
    EXPECT_EQ(checker.failures(), 0u) << text_of(checker);
    EXPECT_GT(find(checker, "inside-closed")->checked, 0u);
    // Without what closes it, the inside is open.
    Made open = m;
    open.bsp.closed.clear();
    Checker other = Checker::collecting(5);
    verify_bsp(open.world, open.csg, open.bsp, true, {.points = 100, .seed = 1}, other);
    EXPECT_GT(find(other, "inside-closed")->failed, 0u);
}

struct Mutation {
    const char* name;
    const char* code; // of the check that has to see it
    std::function<void(Made&)> change;
};
void PrintTo(const Mutation& m, std::ostream* out) { *out << m.name; }

std::size_t first_fragment(const Made& m, Contents behind) {
    for (std::size_t i = 0; i < m.csg.fragments.size(); ++i)
        if (m.csg.fragments[i].behind == behind && m.csg.fragments[i].model.value == 0) return i;
    throw std::logic_error("no such fragment");
}
Face& hull_face(Made& m) {
    for (Face& f : m.surfaces.faces)
        if (f.hull && f.triangle_count >= 2 && f.chart.valid()) return f;
    throw std::logic_error("no such face");
}

class Mutations : public ::testing::TestWithParam<Mutation> {};

TEST_P(Mutations, AreSeenByTheCheckThatIsAboutThem) {
    static const Made clean = two_rooms();
    Made m = clean;
    GetParam().change(m);
    // Stage by stage, so that what precedes does not hide it: only the artefact that was changed is looked at.
    const VerifyOptions options{.points = 4000, .seed = 1};
    Checker checker = Checker::collecting(5);
    verify_world(m.world, checker);
    if (checker.failures() == 0) {
        verify_csg(m.world, m.csg, options, checker);
        verify_bsp(m.world, m.csg, m.bsp, true, options, checker);
        if (checker.failures() == 0) verify_surfaces(m.world, m.csg, m.bsp, m.surfaces, options, checker);
        if (checker.failures() == 0) verify_visibility(m.world, m.bsp, m.visibility, options, checker);
    }
    const Check* check = find(checker, GetParam().code);
    ASSERT_NE(check, nullptr) << text_of(checker);
    EXPECT_GT(check->failed, 0u) << text_of(checker);
}

const Mutation kMutations[] = {
    {"SideWithoutMaterial", "world-sides", [](Made& m) { m.world.sides[3].material = {99}; }},
    {"BrushOfNoEntity", "world-brushes", [](Made& m) { m.world.brushes[2].entity = {77}; }},
    {"ModelOutOfOrder", "world-entities", [](Made& m) { m.world.model_count = 5; }},
    {"PolytopeTooFew", "csg-tables", [](Made& m) { m.csg.brushes.pop_back(); }},
    {"PolygonBackwards", "polygons", [](Made& m) { std::ranges::reverse(m.csg.brushes[0].faces[0].edges); }},
    {"PolytopeLosesAFace", "polytope-closed", [](Made& m) { m.csg.brushes[0].faces.pop_back(), m.csg.brushes[0].sides.pop_back(); }},
    {"PolytopeBoundsShrink", "polytope-closed", [](Made& m) { m.csg.brushes[0].bounds.hi.x -= 1; }},
    {"PolytopeFaceOfAnotherPlane", "polytope-convex",
     [](Made& m) { // a face of a brush moves to a parallel plane further in
         for (BrushPolytope& of : m.csg.brushes)
             for (PlanePolygon& face : of.faces)
                 for (const BrushPolytope& brush : m.csg.brushes)
                     for (const PlanePolygon& other : brush.faces)
                         if (m.csg.planes.parallel(other.support, face.support) == 1 && m.csg.planes.distance(other.support) < m.csg.planes.distance(face.support)) {
                             face.support = other.support;
                             return;
                         }
         throw std::logic_error("no such plane");
     }},
    {"FragmentDropped", "fragments-closed", [](Made& m) { m.csg.fragments.erase(m.csg.fragments.begin() + static_cast<std::ptrdiff_t>(first_fragment(m, Contents::solid))); }},
    {"FragmentGrowsBack", "fragments-uncovered",
     [](Made& m) { // a whole side of the wall between the rooms, though the frame around covers parts of it
         for (Fragment& f : m.csg.fragments)
             for (std::size_t i = 0; i < m.csg.brushes[f.brush.at()].faces.size(); ++i)
                 if (m.csg.brushes[f.brush.at()].sides[i] == f.side) f.polygon = m.csg.brushes[f.brush.at()].faces[i];
     }},
    {"FragmentOfANeighbour", "fragments-in-brush",
     [](Made& m) {
         const std::size_t i = first_fragment(m, Contents::solid);
         for (Fragment& f : m.csg.fragments)
             if (f.brush != m.csg.fragments[i].brush && f.model.value == 0) { m.csg.fragments[i].polygon = f.polygon; break; }
     }},
    {"NodeChildTwice", "tree", [](Made& m) { m.bsp.nodes[0].child[1] = m.bsp.nodes[0].child[0]; }},
    {"ChildrenSwapped", "leaf-polytopes",
     [](Made& m) {
         for (BspNode& n : m.bsp.nodes) // of a node between air and solid
             if (n.child[0] < 0 && n.child[1] < 0) { std::swap(n.child[0], n.child[1]); break; }
     }},
    {"NodePlaneMovedForLookUps", "points-in-one-leaf", [](Made& m) { m.bsp.nodes[0].distance += 3; }},
    {"NodePlaneOfNothing", "leaf-polytopes", [](Made& m) { for (BspNode& n : m.bsp.nodes) n.plane = m.bsp.box[0]; }},
    {"LeafContents", "points-contents",
     [](Made& m) {
         for (BspLeaf& l : m.bsp.leaves)
             if (l.contents == Contents::water) l.contents = Contents::lava;
         for (WaterVolume& w : m.bsp.waters) w.contents = Contents::lava; // alike, so that only the brushes contradict
     }},
    {"LeafForgetsItsBrushes", "points-brushes", [](Made& m) { for (BspLeaf& l : m.bsp.leaves) l.brushes.clear(); }},
    {"LeafClusterMissing", "leaves",
     [](Made& m) {
         for (BspLeaf& l : m.bsp.leaves)
             if (l.cluster.valid()) { l.cluster = {}; break; }
     }},
    {"LeafBoundsGrow", "leaf-polytopes", [](Made& m) { m.bsp.leaves[0].bounds.lo.x -= 1, m.bsp.leaves[0].bounds.hi.x += 1; }},
    {"PortalDropped", "portals-complete", [](Made& m) { m.bsp.portals.erase(m.bsp.portals.begin(), m.bsp.portals.begin() + static_cast<std::ptrdiff_t>(m.bsp.portals.size() / 2)); }},
    {"PortalOfOtherLeaves", "portal-between-leaves",
     [](Made& m) { // the same leaves, the other way round
         std::swap(m.bsp.portals[0].leaf_front, m.bsp.portals[0].leaf_back);
     }},
    {"PortalToSolid", "portals",
     [](Made& m) {
         for (std::size_t l = 0; l < m.bsp.leaves.size(); ++l)
             if (!m.bsp.leaves[l].open()) m.bsp.portals[0].leaf_back = id<LeafId>(l);
     }},
    {"PortalWindingShifted", "portal-shape", [](Made& m) { m.bsp.portals[0].winding[0] = (m.bsp.portals[0].winding[0] + m.bsp.portals[0].winding[1]) * 0.5; }},
    {"AreasMixed", "areas",
     [](Made& m) {
         for (BspLeaf& l : m.bsp.leaves)
             if (l.area == 1) { l.area = 2; break; }
     }},
    {"VisiblePartDropped", "visible-complete", [](Made& m) { m.bsp.visible.erase(m.bsp.visible.begin(), m.bsp.visible.begin() + static_cast<std::ptrdiff_t>(m.bsp.visible.size() / 2)); }},
    {"VisiblePartOfAnotherLeaf", "visible-in-leaf",
     [](Made& m) {
         for (VisibleFragment& v : m.bsp.visible)
             for (std::size_t l = 0; l < m.bsp.leaves.size(); ++l)
                 if (v.leaf.valid() && m.bsp.leaves[l].cluster.valid() && l != v.leaf.at() && !overlap(m.bsp.leaves[l].bounds, m.bsp.leaves[v.leaf.at()].bounds)) {
                     v.leaf = id<LeafId>(l);
                     return;
                 }
     }},
    {"TriangleTurned", "triangles", [](Made& m) { std::swap(m.surfaces.triangles[hull_face(m).first_triangle][0], m.surfaces.triangles[hull_face(m).first_triangle][1]); }},
    {"TriangleNamesNothing", "triangles", [](Made& m) { m.surfaces.triangles[5][1] = 1u << 30; }},
    {"FaceAreaWrong", "faces", [](Made& m) { hull_face(m).area *= 1.01; }},
    {"FaceMaterialWrong", "face-sources", [](Made& m) { m.world.materials.push_back(m.world.materials[0]), hull_face(m).material = id<MaterialId>(m.world.materials.size() - 1); }},
    {"PositionSplit", "hull-edges",
     [](Made& m) { // one corner of one triangle gets a position of its own at the same place
         std::uint32_t& p = m.surfaces.triangles[hull_face(m).first_triangle][0];
         m.surfaces.positions.push_back(m.surfaces.positions[p]);
         p = static_cast<std::uint32_t>(m.surfaces.positions.size() - 1);
     }},
    {"PositionTwice", "positions-welded",
     [](Made& m) {
         std::uint32_t& p = m.surfaces.triangles[hull_face(m).first_triangle][0];
         m.surfaces.positions.push_back(m.surfaces.positions[p]);
         p = static_cast<std::uint32_t>(m.surfaces.positions.size() - 1);
     }},
    {"HullFaceTakenOut", "hull-edges", [](Made& m) { hull_face(m).hull = false; }},
    {"HullFaceUncounted", "face-areas", [](Made& m) { hull_face(m).hull = false; }},
    {"TJunction", "t-junctions",
     [](Made& m) { // a triangle is cut in two from the middle of an edge, its neighbour is not
         const Face f = hull_face(m);
         const std::size_t t = f.first_triangle;
         const auto [a, b, c] = m.surfaces.triangles[t];
         const std::uint32_t mid = static_cast<std::uint32_t>(m.surfaces.positions.size());
         m.surfaces.positions.push_back((m.surfaces.positions[a] + m.surfaces.positions[b]) * 0.5);
         const auto at = static_cast<std::ptrdiff_t>(t);
         m.surfaces.triangles[t] = {a, mid, c};
         m.surfaces.triangles.insert(m.surfaces.triangles.begin() + at + 1, {mid, b, c});
         m.surfaces.triangle_face.insert(m.surfaces.triangle_face.begin() + at, m.surfaces.triangle_face[t]);
         m.surfaces.corner_normals.insert(m.surfaces.corner_normals.begin() + at, m.surfaces.corner_normals[t]);
         for (Face& g : m.surfaces.faces)
             if (g.first_triangle > t) ++g.first_triangle;
             else if (g.first_triangle == t) ++g.triangle_count;
     }},
    {"ChartTexelsShifted", "charts", [](Made& m) { ++m.surfaces.charts[1].first_texel; }},
    {"LuxelDropped", "luxel-cover",
     [](Made& m) {
         const Luxel l = m.surfaces.luxels.back();
         m.surfaces.luxels.pop_back();
         std::uint32_t n = 0;
         for (std::uint32_t p = l.first_piece; p < l.first_piece + l.piece_count; ++p) n += m.surfaces.pieces[p].point_count;
         m.surfaces.piece_points.resize(m.surfaces.piece_points.size() - n);
         m.surfaces.pieces.resize(m.surfaces.pieces.size() - l.piece_count);
         if (l.centroid != UINT32_MAX) m.surfaces.centroids.pop_back();
     }},
    {"LuxelPieceOutOfItsSquare", "luxels", [](Made& m) { --m.surfaces.pieces[0].first_point; }},
    {"ChartElsewhere", "luxels-on-faces",
     [](Made& m) {
         for (Chart& c : m.surfaces.charts) c.origin += c.s * (c.luxel_size * c.width);
     }},
    {"SeamOfNothing", "seams", [](Made& m) { m.surfaces.seams.push_back({{0}, {1u << 20}, 0, 1}); }},
    {"VisOneSided", "vis-rows", [](Made& m) { m.visibility.rows[0] ^= std::uint64_t{1} << (m.visibility.cluster_count - 1); }},
    {"VisBlind", "vis-neighbours",
     [](Made& m) {
         for (std::uint32_t a = 0; a < m.visibility.cluster_count; ++a)
             for (std::uint32_t b = 0; b < m.visibility.cluster_count; ++b)
                 if (a != b) m.visibility.rows[a * m.visibility.words_per_row() + b / 64] &= ~(std::uint64_t{1} << (b % 64));
     }},
    {"VisBlindAtADistance", "vis-clear-segments",
     [](Made& m) {
         for (std::uint32_t a = 0; a < m.visibility.cluster_count; ++a)
             for (std::uint32_t b = 0; b < m.visibility.cluster_count; ++b)
                 if (a != b && std::ranges::none_of(m.bsp.portals, [&](const BspPortal& p) {
                         const std::uint32_t x = m.bsp.leaves[p.leaf_front.at()].cluster.value, y = m.bsp.leaves[p.leaf_back.at()].cluster.value;
                         return (x == a && y == b) || (x == b && y == a);
                     }))
                     m.visibility.rows[a * m.visibility.words_per_row() + b / 64] &= ~(std::uint64_t{1} << (b % 64));
     }},
};
INSTANTIATE_TEST_SUITE_P(OneAtATime, Mutations, ::testing::ValuesIn(kMutations), [](const auto& test) { return std::string(test.param.name); });

TEST(Verify, ValidateStopsAtTheFirst) {
    Made m = two_rooms();
    validate(m.bsp, m.csg);
    m.bsp.portals[0].leaf_back = m.bsp.portals[0].leaf_front;
    EXPECT_THROW(validate(m.bsp, m.csg), InternalError);
}

TEST(Verify, DocumentFaults) {
    Context context;
    const std::string text = "{\n\"classname\" \"worldspawn\"\n{\n( 0 0 0 ) ( 0 1 0 ) ( 0 0 1 ) w 0 0 0 1 1\n}\n}\n{\n\"classname\" \"light\"\n}\n";
    const Bytes bytes(text.begin(), text.end());
    const Document clean = *read_quake_map(bytes, "a.map", context);
    const auto failed = [](const Document& d, const char* code) {
        Checker checker = Checker::collecting(5);
        verify_document(d, checker);
        return find(checker, code)->failed;
    };
    for (const char* code : {"document-ids", "document-brushes", "document-sides", "document-patches", "document-displacements"}) EXPECT_EQ(failed(clean, code), 0u) << code;
    Document d = clean;
    d.entities.push_back(d.entities[1]);
    EXPECT_EQ(failed(d, "document-ids"), 1u);
    d = clean;
    d.entities[0].brushes[0].sides.clear();
    EXPECT_EQ(failed(d, "document-brushes"), 1u);
    d = clean;
    d.entities[0].brushes[0].sides[0].texture.u_scale = 0;
    EXPECT_EQ(failed(d, "document-sides"), 1u);
    d = clean;
    d.displacements.emplace_back(); // of no side, and with a table that does not fit
    d.displacements[0].power = 2, d.displacements[0].alphas.resize(24);
    EXPECT_EQ(failed(d, "document-displacements"), 2u);
    d = clean;
    d.entities[0].patches.emplace_back();
    EXPECT_GT(failed(d, "document-patches"), 0u);
}

class RealMaps : public ::testing::TestWithParam<const char*> {};

TEST_P(RealMaps, PassEveryCheck) {
    const std::filesystem::path path = std::filesystem::path(KILN_SOURCE_DIR) / GetParam();
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "map collection not here: " << path;
    const auto bytes = read_file(path.string());
    ASSERT_TRUE(bytes);
    Context context;
    const auto document = path.extension() == ".vmf" ? read_vmf(*bytes, path.string(), context) : read_quake_map(*bytes, path.string(), context);
    ASSERT_TRUE(document);
    MaterialDatabase materials;
    Made m;
    m.world = *build_world(*document, materials, {}, context);
    m.csg = *build_csg(m.world, {}, context);
    m.bsp = *build_bsp(m.world, m.csg, {}, context);
    m.surfaces = *build_surfaces(m.world, m.csg, m.bsp, {}, context);
    Checker checker = Checker::collecting(5);
    verify_document(*document, checker);
    verify_world(m.world, checker);
    verify_csg(m.world, m.csg, {}, checker);
    verify_bsp(m.world, m.csg, m.bsp, true, {}, checker);
    verify_surfaces(m.world, m.csg, m.bsp, m.surfaces, {}, checker);
    EXPECT_EQ(checker.failures(), 0u) << text_of(checker);
    EXPECT_GT(find(checker, "points-contents")->checked, 10000u);
    EXPECT_GT(find(checker, "portals-complete")->checked, 3u);
    if (!m.surfaces.curves.empty()) {
        EXPECT_GT(find(checker, "curve-luxels")->checked, 100u);
        EXPECT_GT(find(checker, "curves-seen")->checked, 100u);
    }
}
INSTANTIATE_TEST_SUITE_P(Maps, RealMaps,
                         ::testing::Values("maps/atrium/atrium.vmf", "maps/terrain/terrain.vmf", "../shared/maps/id-quake-map-source/e1m1.map", "../shared/maps/athwale-hammer/lambda_bunker_v2.vmf",
                                           "../shared/maps/ericw-tools-testmaps/q2_areaportals.map"),
                         [](const auto& test) {
                             std::string name = std::filesystem::path(test.param).stem().string();
                             std::erase_if(name, [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); });
                             return name;
                         });

} // namespace
} // namespace kiln
