// Maps people made: sealed ones have closed hulls, whatever their geometry, and every invariant holds.
#include "compiler/surfaces/surfaces.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include "libs/core/hash.h"
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <iterator>

namespace kiln {
namespace {

struct Case {
    const char* path;
    std::size_t least_faces;
};
class RealMaps : public ::testing::TestWithParam<Case> {};

TEST_P(RealMaps, HullIsClosedAndTablesAreValid) {
    const std::filesystem::path path = std::filesystem::path(KILN_SOURCE_DIR) / "../shared/maps" / GetParam().path;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "map collection not here: " << GetParam().path;
    std::ifstream in(path, std::ios::binary);
    const Bytes bytes((std::istreambuf_iterator<char>(in)), {});
    const std::string name = path.filename().string();
    Hash first;
    for (const int threads : {1, 3}) {
        Context context;
        context.threads = threads;
        Result<Document> document = name.ends_with(".vmf") ? read_vmf(bytes, name, context) : read_quake_map(bytes, name, context);
        ASSERT_TRUE(document);
        MaterialDatabase materials;
        const Result<World> world = build_world(*document, materials, {}, context);
        ASSERT_TRUE(world);
        const Result<Csg> csg = build_csg(*world, {}, context);
        ASSERT_TRUE(csg);
        const Result<Bsp> bsp = build_bsp(*world, *csg, {}, context);
        ASSERT_TRUE(bsp) << to_text(bsp.fault().diagnostic);
        const Result<Surfaces> s = build_surfaces(*world, *csg, *bsp, {}, context);
        ASSERT_TRUE(s);
        validate(*s);
        EXPECT_GT(s->faces.size(), GetParam().least_faces);
        for (std::uint32_t m = 0; m < world->model_count; ++m) EXPECT_EQ(unmatched_hull_edges(*s, {m}), 0u) << "model " << m;
        for (const Diagnostic& d : context.diagnostics())
            EXPECT_FALSE(d.code == "face-not-merged" || d.code == "face-not-triangulated") << to_text(d);
        if (threads == 1)
            first = hash_of(*s);
        else
            EXPECT_EQ(hash_of(*s), first) << "differs with the number of threads";
    }
}

INSTANTIATE_TEST_SUITE_P(Maps, RealMaps,
                         ::testing::Values(Case{"id-quake-map-source/e1m1.map", 3000}, Case{"athwale-hammer/lambda_bunker_v2.vmf", 500},
                                           Case{"laurirasanen-mapsrc/box13.vmf", 5000}, Case{"librequake/lqdm1.map", 1500}),
                         [](const auto& test) {
                             std::string name = std::filesystem::path(test.param.path).stem().string();
                             std::erase_if(name, [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); });
                             return name;
                         });

// Displacements of maps that people made: whoever is somebody's neighbour is sewn to it. What is open is where the map
// ends or has a gap of its own: told in one note. That the grids are turned the right way shows in that they meet at all.
struct CurveCase {
    const char* path;
    std::size_t displacements, patches, most_open_percent;
};
class RealCurves : public ::testing::TestWithParam<CurveCase> {};

TEST_P(RealCurves, MeetWithoutCracks) {
    const std::filesystem::path path = std::filesystem::path(KILN_SOURCE_DIR) / "../shared/maps" / GetParam().path;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "map collection not here: " << GetParam().path;
    std::ifstream in(path, std::ios::binary);
    const Bytes bytes((std::istreambuf_iterator<char>(in)), {});
    const std::string name = path.filename().string();
    Context context;
    Result<Document> document = name.ends_with(".vmf") ? read_vmf(bytes, name, context) : read_quake_map(bytes, name, context);
    ASSERT_TRUE(document);
    MaterialDatabase materials;
    const Result<World> world = build_world(*document, materials, {}, context);
    ASSERT_TRUE(world) << to_text(world.fault().diagnostic);
    validate(*world);
    const Result<Csg> csg = build_csg(*world, {}, context);
    ASSERT_TRUE(csg);
    const Result<Bsp> bsp = build_bsp(*world, *csg, {}, context);
    ASSERT_TRUE(bsp) << to_text(bsp.fault().diagnostic);
    const auto start = std::chrono::steady_clock::now();
    const Result<Surfaces> s = build_surfaces(*world, *csg, *bsp, {}, context);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    ASSERT_TRUE(s);
    validate(*s);
    std::size_t displacements = 0, patches = 0, triangles = 0, border = 0;
    for (const Curve& c : s->curves) {
        (c.kind == Curve::displacement ? displacements : patches) += 1;
        border += 2 * (c.columns - 1 + c.rows - 1);
    }
    triangles = s->curve_corners.size();
    const std::size_t open = unmatched_curve_edges(*s, {0}, displacements ? Curve::displacement : Curve::patch);
    std::printf("%s: %zu displacements, %zu patches, %zu faces of curves, %zu triangles, %zu of %zu border edges open, %.2f s\n", name.c_str(), displacements,
                patches, s->luxel_maps.size(), triangles, open, border, took.count());
    for (const Diagnostic& d : context.diagnostics())
        if (d.code.starts_with("displacement") || d.code.starts_with("patch") || d.code.starts_with("curve")) std::printf("  %s\n", to_text(d).c_str());
    EXPECT_EQ(displacements, GetParam().displacements);
    EXPECT_EQ(patches, GetParam().patches);
    EXPECT_LE(100 * open, GetParam().most_open_percent * border);
}

INSTANTIATE_TEST_SUITE_P(Maps, RealCurves,
                         ::testing::Values(CurveCase{"nmrih-foster-care/nmo_test3.vmf", 948, 0, 5}, CurveCase{"nmrih-foster-care/nmo_southpole_old1.vmf", 22, 0, 78},
                                           CurveCase{"redream-map-files/redream_waterlands.vmf", 31, 0, 53},
                                           CurveCase{"godotvmf-template/examples/displacement.vmf", 9, 0, 100},
                                           CurveCase{"spirit-quake-maps/spirit3ctfduel1.map", 0, 402, 41}),
                         [](const auto& test) {
                             std::string name = std::filesystem::path(test.param.path).stem().string();
                             std::erase_if(name, [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); });
                             return name;
                         });

} // namespace
} // namespace kiln
