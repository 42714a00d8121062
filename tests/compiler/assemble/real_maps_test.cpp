#include "libs/core/file.h"
#include "tests/compiler/assemble/files.h"
#include <filesystem>
#include <set>

namespace kiln::test {
namespace {

namespace fs = std::filesystem;

const fs::path kMaps = fs::path(KILN_SOURCE_DIR) / "../shared/maps";

// Beside the file that names it, with and without ending: all that these maps need.
OpenMap beside() {
    return [](const std::string& wanted, const std::string& from) -> Result<TextFile> {
        for (const char* ending : {"", ".vmf"}) {
            const std::string path = (fs::path(from).parent_path() / (wanted + ending)).string();
            if (fs::is_regular_file(path)) return TextFile{path, *read_file(path)};
        }
        return fault(Exit::input, "cannot-read", "not found");
    };
}
std::optional<Document> assembled_map(const char* name, Context& context, bool alone = false) {
    const std::string path = (kMaps / name).string();
    if (!fs::exists(path)) return std::nullopt;
    const TextFile map{path, *read_file(path)};
    Result<Document> d = alone ? read_document(map, context) : assemble(map, beside(), {}, context);
    if (!d) throw std::runtime_error(to_text(d.fault().diagnostic));
    return *std::move(d);
}
std::size_t brushes(const Document& d) {
    std::size_t n = 0;
    for (const DocEntity& e : d.entities) n += e.brushes.size();
    return n;
}
std::size_t of_class(const Document& d, std::string_view name) {
    return static_cast<std::size_t>(std::ranges::count_if(d.entities, [&](const DocEntity& e) { return equal_ignoring_case(e.get("classname"), name); }));
}

TEST(RealMaps, AllInstancesOfHammerousCourseAreFound) {
    Context context, quiet;
    const std::optional<Document> d = assembled_map("godotvmf-template/mapsrc/Hammerous_course_v01.vmf", context);
    if (!d) GTEST_SKIP() << "no maps at " << kMaps;
    const std::optional<Document> bare = assembled_map("godotvmf-template/mapsrc/Hammerous_course_v01.vmf", quiet, true);
    EXPECT_EQ(count(context, "instance-missing"), 0u);
    EXPECT_EQ(of_class(*d, "func_instance"), 0u);
    // What each file holds, as often as it is named.
    std::size_t wanted = brushes(*bare);
    for (const DocEntity& e : bare->entities) {
        if (!equal_ignoring_case(e.get("classname"), "func_instance")) continue;
        std::string file = "godotvmf-template/mapsrc/" + std::string(e.get("file"));
        if (!file.ends_with(".vmf")) file += ".vmf";
        wanted += brushes(*assembled_map(file.c_str(), quiet));
    }
    EXPECT_GT(of_class(*bare, "func_instance"), 7u);
    EXPECT_EQ(brushes(*d), wanted);
    std::set<int> sides; // ids stay unique
    std::size_t all = 0;
    for (const DocEntity& e : d->entities)
        for (const DocBrush& b : e.brushes)
            for (const DocSide& s : b.sides) sides.insert(s.id), ++all;
    std::set<int> own;
    std::size_t own_all = 0;
    for (const DocEntity& e : bare->entities)
        for (const DocBrush& b : e.brushes)
            for (const DocSide& s : b.sides) own.insert(s.id), ++own_all;
    EXPECT_EQ(all - sides.size(), own_all - own.size()); // no more than the map itself repeats
}

TEST(RealMaps, WhatParableLacksIsToldOncePerInstance) {
    Context context, quiet;
    const std::optional<Document> d = assembled_map("tgs-archive/parable_comp_real.vmf", context);
    if (!d) GTEST_SKIP() << "no maps at " << kMaps;
    const std::optional<Document> bare = assembled_map("tgs-archive/parable_comp_real.vmf", quiet, true);
    EXPECT_EQ(count(context, "instance-missing"), of_class(*bare, "func_instance"));
    EXPECT_EQ(brushes(*d), brushes(*bare));
}

TEST(RealMaps, TheExternalMapOfEricwTools) {
    Context context;
    const std::optional<Document> d = assembled_map("ericw-tools-testmaps/q1_external_map_base.map", context);
    if (!d) GTEST_SKIP() << "no maps at " << kMaps;
    ASSERT_EQ(d->entities.size(), 2u);
    EXPECT_EQ(d->entities[1].get("classname"), "func_group");
    ASSERT_EQ(d->entities[1].brushes.size(), 1u);
    // Turned by 180 degrees about z: the side of x = 64 is that of x = -64 now, and its texture came along.
    const DocSide& side = d->entities[1].brushes[0].sides[5];
    for (const auto& p : side.points) EXPECT_EQ(vec(p).x, -64);
    EXPECT_EQ(side.texture.u_axis, (Vec3{0, -1, 0}));
    EXPECT_EQ(side.texture.v_axis, (Vec3{0, 0, -1}));
}

} // namespace
} // namespace kiln::test
