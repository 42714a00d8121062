// Maps of other people, where they are at hand: every hull closes, nothing is lost.
#include "measure.h"
#include "formats/quake_map/quake_map.h"
#include "formats/vmf/vmf.h"
#include <filesystem>
#include <fstream>
#include <iterator>

namespace kiln::test {
namespace {

// Nothing: the file is not here.
std::optional<World> load_map(const char* name) {
    const std::filesystem::path path = std::filesystem::path(KILN_SOURCE_DIR "/../shared/maps") / name;
    std::ifstream in(path, std::ios::binary);
    if (!in) return std::nullopt;
    const std::vector<std::uint8_t> bytes((std::istreambuf_iterator<char>(in)), {});
    Context context;
    const Result<Document> document = path.extension() == ".vmf" ? read_vmf(bytes, path.string(), context)
                                                                 : read_quake_map(bytes, path.string(), context);
    if (!document) throw std::runtime_error(to_text(document.fault().diagnostic));
    MaterialDatabase materials;
    Result<World> world = build_world(*document, materials, {}, context);
    if (!world) throw std::runtime_error(to_text(world.fault().diagnostic));
    return std::move(*world);
}

class RealMap : public testing::TestWithParam<const char*> {
protected:
    World world;
    void SetUp() override {
        std::optional<World> loaded = load_map(GetParam());
        if (!loaded) GTEST_SKIP() << GetParam() << " is not here";
        world = std::move(*loaded);
    }
};

TEST_P(RealMap, EveryBrushIsValidAndEveryHullCloses) {
    const Csg csg = compile(world);
    EXPECT_EQ(csg.report.invalid_brushes, 0u);
    EXPECT_LE(csg.report.largest_move, CsgOptions{}.plane_merge_distance);
    EXPECT_LT(csg.report.largest_rounding, 2e-3);
    for (std::uint32_t m = 0; m < world.model_count; ++m) {
        const Boundary b = boundary(csg, Contents::solid, ModelId{m});
        if (b.fragments) {
            EXPECT_LT(b.closure(), 1e-13) << "model " << m;
            EXPECT_GT(b.volume, 0) << "model " << m;
        }
    }
}

// The union's volume cannot exceed the sum of the brushes', nor be less than the largest.
TEST_P(RealMap, VolumeIsThatOfTheBrushes) {
    const Csg csg = compile(world);
    double sum = 0, largest = 0;
    for (std::size_t b = 0; b < csg.brushes.size(); ++b) {
        if (world.brushes[b].model.value != 0 || world.brushes[b].contents != Contents::solid) continue;
        Boundary one;
        for (const PlanePolygon& f : csg.brushes[b].faces) add(one, csg.planes, f);
        EXPECT_LT(one.closure(), 1e-10) << "brush " << b;
        sum += one.volume, largest = std::max(largest, one.volume);
    }
    const double all = boundary(csg).volume;
    EXPECT_LE(all, sum * (1 + 1e-12));
    EXPECT_GE(all, largest);
}

INSTANTIATE_TEST_SUITE_P(Maps, RealMap,
                         testing::Values("id-quake-map-source/e1m1.map", "id-quake-map-source/start.map",
                                         "librequake/lqdm1.map", "laurirasanen-mapsrc/box13.vmf",
                                         "athwale-hammer/lambda_bunker_v2.vmf", "athwale-hammer/skybox.vmf",
                                         "godotvmf-template/mapsrc/Hammerous_course_v01.vmf",
                                         "mrtaufner-quake-maps/sm221_mrtaufner.map"),
                         [](const auto& map) {
                             std::string name = std::filesystem::path(map.param).stem().string();
                             for (char& c : name)
                                 if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                             return name;
                         });

// A map turned by odd angles and written with three decimals: what abutted must still abut, with no slivers between.
TEST(CsgTurnedMap, TurningAMapDoesNotShatterIt) {
    const std::optional<World> loaded = load_map("id-quake-map-source/e1m1.map");
    if (!loaded) GTEST_SKIP() << "the map is not here";
    const World& world = *loaded;
    World turned_world = world;
    for (WorldSide& side : turned_world.sides)
        for (auto& point : side.points) {
            const double a = 0.3217, b = 1.1234;
            Vec3 p{point[0].to_double(), point[1].to_double(), point[2].to_double()};
            p = {std::cos(a) * p.x - std::sin(a) * p.y, std::sin(a) * p.x + std::cos(a) * p.y, p.z};
            p = {p.x, std::cos(b) * p.y - std::sin(b) * p.z, std::sin(b) * p.y + std::cos(b) * p.z};
            for (std::size_t k = 0; k < 3; ++k) point[k] = decimal(std::round(p[k] * 1e3) / 1e3);
        }
    const Csg straight = compile(world);
    const Csg turned = compile(turned_world);
    EXPECT_EQ(turned.report.invalid_brushes, 0u);
    EXPECT_EQ(turned.report.kept_brushes, 0u);
    EXPECT_LT(turned.fragments.size(), straight.fragments.size() * 6 / 5);
    const Boundary a = boundary(straight), b = boundary(turned);
    EXPECT_LT(b.closure(), 1e-13);
    EXPECT_NEAR(b.area, a.area, 2e-3 * a.area);
    EXPECT_NEAR(b.volume, a.volume, 1e-3 * a.volume);
}

} // namespace
} // namespace kiln::test
