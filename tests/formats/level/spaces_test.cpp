// Area portals, occluders, water volumes, what brushes stop and faces without dynamic shadows: round trip, absence, lies.
#include "formats/level/kiln_level.hpp"
#include "formats/level/tables.h"
#include "tests/formats/level/forge.h"
#include "tests/formats/level/sample_level.h"
#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <random>

namespace kiln::level {
namespace {

LevelContent sample() {
    LevelContent c = test::mixture(7, 8);
    c.area_portals.push_back({1, 2, {1, 3}, {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}}});
    c.area_portals.push_back({0, 0, {0, 0}, {}});
    c.occluders.push_back({1, 2, {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{5, 5, 5}, {6, 5, 5}, {6, 6, 5}, {5, 6, 5}}}});
    c.occluders.push_back({0, 0, {}});
    c.waters.push_back({4, 32.5f, -8, true, 1});
    c.waters.push_back({6, 99, 1, false, UINT32_MAX});
    for (std::size_t l = 0; l < c.leaves.size(); ++l) c.leaf_water.push_back(l % 3 == 2 ? UINT32_MAX : static_cast<std::uint32_t>(l % 3));
    for (std::size_t l = 0; l < c.leaves.size(); ++l) c.leaf_water_distance.push_back(l % 4 == 3 ? INFINITY : static_cast<float>(l) / 2);
    c.source_files = {"parts/a.vmf", "../b.map"};
    for (std::size_t b = 0; b < c.brushes.size(); ++b) c.brushes[b].source_file = b % 3;
    for (std::size_t f = 0; f < c.faces.size(); ++f) c.faces[f].source_file = (f + 1) % 3;
    c.entities.at(1).source_file = 2, c.lights.at(0).source_file = 1, c.displacements.at(1).source_file = 2, c.patches.at(0).source_file = 1;
    for (std::size_t b = 0; b < c.brushes.size(); ++b) c.brushes[b].blocks = static_cast<std::uint8_t>(b % 16);
    c.faces.at(1).no_dynamic_shadow = true;
    return c;
}

TEST(LevelSpaces, ComeBackAsTheyWere) {
    const LevelContent c = sample();
    ASSERT_GE(c.brushes.size(), 3u);
    ASSERT_GE(c.entities.size(), 2u);
    for (const bool strip : {false, true}) {
        const auto bytes = write_level(c, {.strip = strip});
        const Level level(bytes);
        ASSERT_EQ(kiln_level_check(level.get(), nullptr), KILN_OK);
        const auto portals = level.area_portals();
        ASSERT_EQ(portals.size(), 2u);
        EXPECT_EQ(portals[0].entity, 1);
        EXPECT_EQ(portals[0].brush, 2u);
        EXPECT_EQ(portals[0].area[0], 1u);
        EXPECT_EQ(portals[0].area[1], 3u);
        EXPECT_EQ(portals[0].point_count, 3u);
        EXPECT_EQ(portals[1].first_point, 3u);
        EXPECT_EQ(portals[1].point_count, 0u);
        ASSERT_EQ(level.area_portal_points().size(), 9u);
        for (std::size_t i = 0; i < 9; ++i) EXPECT_EQ(level.area_portal_points()[i], static_cast<float>(i));

        ASSERT_EQ(level.occluders().size(), 2u);
        EXPECT_EQ(level.occluders()[0].polygon_count, 2u);
        EXPECT_EQ(level.occluders()[0].area, 2u);
        EXPECT_EQ(level.occluders()[1].first_polygon, 2u);
        ASSERT_EQ(level.occluder_polygons().size(), 2u);
        EXPECT_EQ(level.occluder_polygons()[1].first_point, 3u);
        EXPECT_EQ(level.occluder_polygons()[1].point_count, 4u);
        EXPECT_EQ(level.occluder_points().size(), 21u);
        EXPECT_EQ(level.occluder_points()[20], 5.0f);

        ASSERT_EQ(level.waters().size(), 2u);
        EXPECT_EQ(level.waters()[0].surface_z, 32.5f);
        EXPECT_EQ(level.waters()[0].min_z, -8.0f);
        EXPECT_EQ(level.waters()[0].material, 1u);
        EXPECT_EQ(level.waters()[1].has_surface, 0u);
        EXPECT_EQ(level.waters()[1].material, KILN_NO_INDEX);
        EXPECT_TRUE(std::ranges::equal(level.leaf_waters(), c.leaf_water));

        EXPECT_TRUE(std::ranges::equal(level.leaf_water_distances(), c.leaf_water_distance));

        const char* file = nullptr;
        if (strip) {
            EXPECT_EQ(kiln_level_face_file(level.get(), 0, &file), KILN_MISSING);
            EXPECT_EQ(kiln_level_patch_file(level.get(), 0, &file), KILN_MISSING);
        } else {
            const std::string names[] = {"", "parts/a.vmf", "../b.map"};
            for (std::uint32_t b = 0; b < c.brushes.size(); ++b) {
                ASSERT_EQ(kiln_level_brush_file(level.get(), b, &file), KILN_OK);
                EXPECT_EQ(file, names[b % 3]);
            }
            for (std::uint32_t f = 0; f < c.faces.size(); ++f) {
                ASSERT_EQ(kiln_level_face_file(level.get(), f, &file), KILN_OK);
                EXPECT_EQ(file, names[(f + 1) % 3]);
            }
            const auto is = [&](auto get, std::uint32_t i, const std::string& name) {
                ASSERT_EQ(get(level.get(), i, &file), KILN_OK);
                EXPECT_EQ(file, name);
            };
            is(kiln_level_entity_file, 0, ""), is(kiln_level_entity_file, 1, "../b.map"), is(kiln_level_light_file, 0, "parts/a.vmf");
            is(kiln_level_displacement_file, 1, "../b.map"), is(kiln_level_patch_file, 0, "parts/a.vmf"), is(kiln_level_patch_file, 1, "");
            EXPECT_EQ(kiln_level_brush_file(level.get(), static_cast<std::uint32_t>(c.brushes.size()), &file), KILN_BAD_ARGUMENT);
        }

        ASSERT_EQ(level.brush_blocks().size(), c.brushes.size());
        for (std::size_t b = 0; b < c.brushes.size(); ++b) EXPECT_EQ(level.brush_blocks()[b], b % 16);
        ASSERT_EQ(level.face_no_dynamic_shadow().size(), c.faces.size());
        for (std::size_t f = 0; f < c.faces.size(); ++f) EXPECT_EQ(level.face_no_dynamic_shadow()[f], f == 1);
    }
}

// Three rooms in a row, 1, 2 and 3, with two area portals between (clusters 3 and 4, in no area), and one that parts nothing.
LevelContent rooms_with_doors() {
    LevelContent c = test::mixture(7, 8);
    for (Leaf& l : c.leaves) l.cluster = -1, l.area = 0;
    for (std::uint32_t k = 0; k < 5; ++k) c.leaves.at(k).cluster = static_cast<std::int32_t>(k), c.leaves[k].area = k < 3 ? k + 1 : 0;
    c.leaves.at(5).cluster = 0, c.leaves[5].area = 1; // of two leaves
    c.cluster_count = 5;
    c.vis_rows = {0b11111, 0b11111, 0b11111, 0b11111, 0b11111};
    c.shut_rows = {0b01001, 0b11010, 0b10100, 0b11111, 0b11111};
    c.area_portals = {{0, 0, {1, 2}, {}}, {0, 0, {2, 3}, {}}, {0, 0, {2, 2}, {}}};
    return c;
}

TEST(LevelSpaces, RowsWhileAreaPortalsAreShut) {
    const LevelContent c = rooms_with_doors();
    const auto bytes = write_level(c, {});
    const Level level(bytes);
    ASSERT_EQ(kiln_level_check(level.get(), nullptr), KILN_OK);
    const auto row = [&](std::int32_t cluster, std::vector<std::uint8_t> open) {
        std::uint64_t bits = 0;
        EXPECT_EQ(kiln_level_read_door_row(level.get(), cluster, open.data(), &bits, 1), KILN_OK);
        return bits;
    };
    for (std::int32_t k = 0; k < 5; ++k) {
        std::uint64_t bits = 0;
        ASSERT_EQ(kiln_level_read_shut_row(level.get(), k, &bits, 1), KILN_OK);
        EXPECT_EQ(bits, c.shut_rows[static_cast<std::size_t>(k)]);
        EXPECT_EQ(row(k, {0, 0, 0}), c.shut_rows[static_cast<std::size_t>(k)]);
        EXPECT_EQ(row(k, {0, 0, 1}), c.shut_rows[static_cast<std::size_t>(k)]); // what parts nothing opens nothing
        EXPECT_EQ(row(k, {1, 1, 0}), c.vis_rows[static_cast<std::size_t>(k)]);
    }
    EXPECT_EQ(row(0, {1, 0, 0}), 0b11011u); // two rooms, and both doors
    EXPECT_EQ(row(1, {1, 0, 0}), 0b11011u);
    EXPECT_EQ(row(2, {1, 0, 0}), 0b10100u); // its own is shut
    EXPECT_EQ(row(0, {0, 1, 0}), 0b01001u);
    EXPECT_EQ(row(4, {0, 0, 0}), 0b11111u);
    std::uint64_t bits = 0;
    const std::uint8_t open[3] = {};
    EXPECT_EQ(kiln_level_read_shut_row(level.get(), 5, &bits, 1), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_shut_row(level.get(), -1, &bits, 1), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_shut_row(level.get(), 0, &bits, 0), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_shut_row(level.get(), 0, nullptr, 1), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_shut_row(nullptr, 0, &bits, 1), KILN_BAD_ARGUMENT);
    for (const std::int32_t wrong : {-1, 5}) EXPECT_EQ(kiln_level_read_door_row(level.get(), wrong, open, &bits, 1), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_door_row(level.get(), 0, nullptr, &bits, 1), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_door_row(level.get(), 0, open, nullptr, 1), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_door_row(level.get(), 0, open, &bits, 0), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_level_read_door_row(nullptr, 0, open, &bits, 1), KILN_BAD_ARGUMENT);

    LevelContent older = c; // a level of before: the open rows, within what is connected
    older.shut_rows.clear();
    const auto old_bytes = write_level(older, {});
    const Level old_level(old_bytes);
    ASSERT_EQ(kiln_level_read_shut_row(old_level.get(), 0, &bits, 1), KILN_OK);
    EXPECT_EQ(bits, 0b11111u);
    older.area_portals.clear();
    const auto plain_bytes = write_level(older, {});
    const Level plain(plain_bytes);
    ASSERT_EQ(kiln_level_read_door_row(plain.get(), 0, nullptr, &bits, 1), KILN_OK);
    EXPECT_EQ(bits, 0b11111u);

    LevelContent wrong = c;
    wrong.shut_rows.pop_back();
    EXPECT_THROW(write_level(wrong, {}), std::invalid_argument);
}

// Each byte of the lump: refused, or read as it was; rows beyond a damaged block are not made up.
TEST(LevelSpaces, DamagedRowsOfShutAreaPortals) {
    auto bytes = write_level(rooms_with_doors(), {});
    std::uint64_t offset = 0, size = 0;
    {
        const Level level(bytes);
        for (std::size_t i = 0; i < kiln_level_lump_count(level.get()); ++i) {
            kiln_lump lump{};
            kiln_level_lump(level.get(), i, &lump);
            if (std::string_view(lump.name) == "VISS") offset = lump.offset, size = lump.stored_size;
        }
    }
    ASSERT_GT(size, 0u);
    for (std::uint64_t k = 0; k < size; ++k) {
        bytes[offset + k] ^= 0x5a;
        kiln_level* damaged = nullptr;
        if (kiln_level_open_memory(bytes.data(), bytes.size(), &damaged) == KILN_OK) {
            std::uint64_t bits = 0;
            EXPECT_NE(kiln_level_check(damaged, nullptr), KILN_OK);
            EXPECT_NE(kiln_level_read_shut_row(damaged, 0, &bits, 1), KILN_OK);
            EXPECT_EQ(kiln_level_read_pvs_row(damaged, 0, &bits, 1), KILN_OK);
        }
        kiln_level_close(damaged);
        bytes[offset + k] ^= 0x5a;
    }
    test::Forge forge(bytes); // with intent: a cluster names a row that is not there
    forge["VISS"].bytes[8] = 200;
    const auto forged = forge.bytes();
    const Level level(forged);
    std::uint64_t bits = 0;
    EXPECT_EQ(kiln_level_check(level.get(), nullptr), KILN_DAMAGED);
    EXPECT_EQ(kiln_level_read_shut_row(level.get(), 0, &bits, 1), KILN_DAMAGED);
}

TEST(LevelSpaces, AreNotThereWhereThereIsNothingToSay) {
    const auto bytes = write_level(test::mixture(7, 8), {});
    const Level level(bytes);
    EXPECT_TRUE(level.area_portals().empty());
    EXPECT_TRUE(level.occluders().empty());
    EXPECT_TRUE(level.waters().empty());
    EXPECT_TRUE(level.leaf_waters().empty());
    EXPECT_TRUE(level.leaf_water_distances().empty());
    const char* file = nullptr;
    ASSERT_EQ(kiln_level_face_file(level.get(), 0, &file), KILN_OK); // all of the map itself
    EXPECT_STREQ(file, "");
    EXPECT_TRUE(level.face_no_dynamic_shadow().empty());
    for (std::size_t i = 0; i < kiln_level_lump_count(level.get()); ++i) {
        kiln_lump lump{};
        kiln_level_lump(level.get(), i, &lump);
        for (const char* name : {"VISS", "AREA", "OCCL", "WATR", "LWTR", "FILE", "FSHD", "CUBB"}) EXPECT_STRNE(lump.name, name);
    }
    size_t count = 7;
    EXPECT_EQ(kiln_level_waters(nullptr, &count), nullptr);
    EXPECT_EQ(count, 0u);
    EXPECT_EQ(kiln_level_area_portal_points(nullptr, nullptr), nullptr);
}

TEST(LevelSpaces, WhatNamesNothingIsRefused) {
    const auto refuses = [](const char* what, const auto& spoil) {
        LevelContent c = sample();
        spoil(c);
        EXPECT_THROW(write_level(c, {}), std::invalid_argument) << what;
    };
    refuses("brush", [](LevelContent& c) { c.area_portals[0].brush = static_cast<std::uint32_t>(c.brushes.size()); });
    refuses("entity", [](LevelContent& c) { c.area_portals[0].entity = -1; });
    refuses("areas", [](LevelContent& c) { c.area_portals[0].area = {3, 1}; });
    refuses("occluder entity", [](LevelContent& c) { c.occluders[0].entity = static_cast<std::int32_t>(c.entities.size()); });
    refuses("occluder polygon", [](LevelContent& c) { c.occluders[0].polygons[0].pop_back(); });
    refuses("material", [](LevelContent& c) { c.waters[0].material = static_cast<std::uint32_t>(c.materials.size()); });
    refuses("water", [](LevelContent& c) { c.leaf_water[0] = 2; });
    refuses("distance", [](LevelContent& c) { c.leaf_water_distance[0] = -1; });
    refuses("no number", [](LevelContent& c) { c.leaf_water_distance[1] = NAN; });
    refuses("distances", [](LevelContent& c) { c.leaf_water_distance.pop_back(); });
    refuses("file", [](LevelContent& c) { c.faces[0].source_file = 3; });
    refuses("leaves", [](LevelContent& c) { c.leaf_water.pop_back(); });
}

// The bytes of a lump are the file's to choose: whatever they are, the reader checks them or says no.
TEST(LevelSpaces, LyingLumpsNeverCrash) {
    std::mt19937_64 rng(5);
    const auto check = [&]<class Table>(Table, const kiln_info& info, const Blob& good) {
        for (int i = 0; i < 4000; ++i) {
            Blob bytes = good;
            for (int k = 0; k < 1 + i % 4 && !bytes.empty(); ++k) bytes[rng() % bytes.size()] = static_cast<std::uint8_t>(rng());
            if (i % 5 == 0) bytes.resize(rng() % (bytes.size() + 1));
            Table table;
            try {
                Get in(bytes);
                table.io(in, info, true);
                in.end();
                if constexpr (requires { table.check(info); }) table.check(info);
            } catch (const Damaged&) {
                continue;
            }
            if constexpr (requires { table.polygons; }) {
                for (const auto& p : table.polygons) EXPECT_LE(std::size_t{p.first_point} + p.point_count, table.points.size());
            }
            if constexpr (std::is_same_v<Table, AreaPortals>) {
                for (const auto& p : table.rows) EXPECT_LE(std::size_t{p.first_point} + p.point_count, table.points.size());
            }
            if constexpr (std::is_same_v<Table, SourceFiles>) {
                for (const std::uint32_t f : table.brushes) EXPECT_LE(f, table.names.size());
                for (const std::uint32_t f : table.patches) EXPECT_LE(f, table.names.size());
            }
            if constexpr (std::is_same_v<Table, CubeBehind>) {
                for (std::uint32_t k = 0; k < 4; ++k) EXPECT_TRUE(table.cells[k] == KILN_NO_INDEX || (table.cells[k] > k && table.cells[k] < 4));
            }
            if constexpr (std::is_same_v<Table, Waters>) {
                for (const std::uint32_t w : table.of_leaf) EXPECT_TRUE(w == KILN_NO_INDEX || w < table.rows.size());
            }
        }
    };
    kiln_info info{};
    info.leaves = 4, info.brushes = 3, info.entities = 2, info.materials = 2, info.faces = 5;
    const auto bytes_of = [&](auto table) {
        Put out;
        table.io(out, info, false);
        return out.bytes;
    };
    AreaPortals areas;
    areas.rows = {{1, 2, {1, 3}, 0, 3}, {0, 0, {0, 0}, 0, 0}};
    areas.points.resize(3);
    check(AreaPortals{}, info, bytes_of(areas));
    Occluders occluders;
    occluders.rows = {{1, 2, 0, 2}};
    occluders.polygons = {{0, 3}, {0, 4}};
    occluders.points.resize(7);
    check(Occluders{}, info, bytes_of(occluders));
    Waters waters;
    waters.rows = {{4, 1, 0, 1, 1}};
    waters.of_leaf = {0, KILN_NO_INDEX, 0, 0};
    check(Waters{}, info, bytes_of(waters));
    check(BrushBlocks{}, info, Blob(3));
    check(WaterDistances{}, info, bytes_of(WaterDistances{{0, 1.5f, INFINITY, 99}}));
    SourceFiles files{{"a.vmf", "parts/b.vmf"}, {0, 1, 2, 0, 1}, {0, 1, 2}, {0, 2}, {}, {1}, {2, 0}};
    check(SourceFiles{}, info, bytes_of(files));
    check(FaceShadows{}, info, Blob(5));
    info.cube_cells = 4;
    check(CubeBehind{}, info, bytes_of(CubeBehind{{2, 3, KILN_NO_INDEX, KILN_NO_INDEX}}));
}

} // namespace
} // namespace kiln::level
