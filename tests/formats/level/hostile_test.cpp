// Files that are cut, damaged or made to harm: an error, never a crash. Run under ASan and UBSan as well.
#include "formats/level/kiln_level.hpp"
#include "formats/level/tables.h"
#include "tests/formats/level/forge.h"
#include "tests/formats/level/sample_level.h"
#include <cstring>
#include <gtest/gtest.h>

namespace kiln::level {
namespace {

using test::Bytes;
using test::Forge;

// Calls everything there is, so that any unchecked index would be used.
int use_everything(const Bytes& bytes) {
    // An exact heap copy: reading one byte past the end is seen by the sanitizer.
    const std::unique_ptr<std::uint8_t[]> copy(new std::uint8_t[std::max<std::size_t>(1, bytes.size())]);
    std::copy(bytes.begin(), bytes.end(), copy.get());
    kiln_level* level = nullptr;
    if (kiln_level_open_memory(copy.get(), bytes.size(), &level) != KILN_OK) {
        EXPECT_EQ(level, nullptr);
        return 0;
    }
    const int faults = kiln_level_check(level, nullptr) == KILN_OK ? 0 : 1;
    kiln_info info{};
    kiln_level_info(level, &info);
    const double points[3][3] = {{0, 0, 0}, {100, -100, 50}, {NAN, INFINITY, -1e300}};
    for (const auto& p : points) {
        kiln_level_find_leaf(level, p);
        float rgb[3], cube[6][3];
        const float n[3] = {0.6f, 0, 0.8f}, bad[3] = {NAN, INFINITY, 0};
        for (std::uint32_t f = 0; f < std::min(info.faces, 40u); ++f) {
            double uv[2];
            kiln_level_eval_flat(level, f, p, rgb), kiln_level_eval_rnm(level, f, p, n, rgb);
            kiln_level_eval_rnm_local(level, f, p, bad, rgb), kiln_level_shading_normal(level, f, p, rgb);
            kiln_level_texture_uv(level, f, p, uv), kiln_level_luxel_at(level, f, p, uv);
            double w[3];
            kiln_level_triangle_at(level, f, p, w);
            float t[3], b[3], up[3];
            kiln_level_tangent_frame_at(level, f, p, n, t, b, up);
            std::size_t triangles = 0;
            const kiln_curve_corner* corners = kiln_level_curve_corners(level, f, &triangles);
            for (std::size_t k = 0; k < 3 * triangles; ++k) rgb[0] = corners[k].alpha;
        }
        kiln_level_ambient(level, p, cube), kiln_level_ambient_eval(level, p, n, rgb);
        kiln_light_weight weights[4];
        std::size_t count = 0;
        kiln_level_ambient_lights(level, p, weights, 4, &count);
        const std::uint32_t probe = kiln_level_nearest_cubemap(level, p);
        kiln_level_sample_cubemap(level, probe, n, 0.4f, rgb), kiln_level_sample_cubemap(level, probe, bad, NAN, rgb);
        kiln_level_parallax_direction(level, probe, p, n, rgb);
        const double none[3] = {}, mins[3] = {-16, -16, -24}, maxs[3] = {16, 16, 32};
        kiln_trace trace{};
        std::uint32_t contents = 0;
        for (const auto& q : points) {
            kiln_trace_box(level, p, q, mins, maxs, UINT32_MAX, &trace), kiln_trace_box(level, p, q, none, none, 0xffffff, &trace);
            for (std::uint32_t m = 0; m < std::min(info.models, 5u); ++m) kiln_trace_model(level, m, none, p, q, mins, maxs, 0xffffff, &trace);
        }
        kiln_point_contents(level, p, &contents), kiln_model_point_contents(level, 1, none, p, &contents);
    }
    for (std::uint32_t b = 0; b < std::min(info.brushes, 40u); ++b) {
        std::size_t bevels = 0;
        kiln_level_brush_bevels(level, b, &bevels);
    }
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(std::min(info.clusters, 80u)); ++c) {
        kiln_level_cluster_visible(level, c, 1);
        std::vector<std::uint64_t> row(std::min<std::size_t>(1000, (info.clusters + std::size_t{63}) / 64));
        kiln_level_read_pvs_row(level, c, row.data(), row.size());
        kiln_level_read_pas_row(level, c, row.data(), row.size());
    }
    std::size_t displacements = 0, patches = 0;
    float last = 0;
    const kiln_displacement* d = kiln_level_displacements(level, &displacements);
    for (std::size_t i = 0; i < displacements; ++i) {
        for (std::uint32_t v = 0; v < 4 * d[i].vertex_count; ++v) last = kiln_level_displacement_vertices(level, nullptr)[4 * std::size_t{d[i].first_vertex} + v];
        for (std::uint32_t v = 0; v < 4 * d[i].blend_count; ++v) last = kiln_level_displacement_blends(level, nullptr)[4 * std::size_t{d[i].first_blend} + v];
        for (std::uint32_t v = 0; v < d[i].tag_count; ++v) last = kiln_level_displacement_tags(level, nullptr)[std::size_t{d[i].first_tag} + v];
    }
    const kiln_curved_patch* patch = kiln_level_curved_patches(level, &patches);
    for (std::size_t i = 0; i < patches; ++i)
        for (std::uint32_t v = 0; v < 5 * patch[i].vertex_count; ++v) last = kiln_level_patch_vertices(level, nullptr)[5 * std::size_t{patch[i].first_vertex} + v];
    EXPECT_TRUE(last == last || last != last);
    kiln_source source{};
    kiln_level_displacement_source(level, 1, &source), kiln_level_patch_source(level, 1, &source);
    for (auto* get : {kiln_level_face_file, kiln_level_brush_file, kiln_level_entity_file, kiln_level_light_file, kiln_level_displacement_file, kiln_level_patch_file})
        for (std::uint32_t i = 0; i < 8; ++i)
            if (const char* file = nullptr; get(level, i, &file) == KILN_OK) last += static_cast<float>(std::strlen(file));
    std::size_t leaves = 0;
    const float* away = kiln_level_leaf_water_distances(level, &leaves);
    for (std::size_t i = 0; i < leaves; ++i) last = std::min(last, away[i]);
    const kiln_pose pose{{1, 2, 3}, {4, 5, 6}, {{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}}};
    const double from[3] = {-300, 20, 30}, to[3] = {300, -10, 40}, low[3] = {-16, -16, -24}, high[3] = {16, 16, 32};
    for (std::uint32_t m = 0; m < std::min(info.models, 5u); ++m) {
        kiln_trace t{};
        std::uint32_t held = 0;
        kiln_trace_posed_model(level, m, &pose, from, to, low, high, 0xffffff, &t), kiln_posed_model_point_contents(level, m, &pose, from, &held);
    }
    for (std::uint32_t e = 0; e < std::min(info.entities, 40u); ++e) kiln_level_entity_value(level, e, "key1");
    std::size_t overlays = 0, parts = 0, corners = 0;
    const kiln_overlay* overlay = kiln_level_overlays(level, &overlays);
    const kiln_overlay_fragment* part = kiln_level_overlay_fragments(level, &parts);
    const kiln_overlay_point* corner = kiln_level_overlay_points(level, &corners);
    float sum = 0;
    for (std::size_t o = 0; o < overlays; ++o)
        for (std::size_t f = overlay[o].first_fragment; f < std::size_t{overlay[o].first_fragment} + overlay[o].fragment_count; ++f) {
            EXPECT_LT(f, parts);
            EXPECT_LT(part[f].face, info.faces);
            for (std::size_t v = part[f].first_point; v < std::size_t{part[f].first_point} + part[f].point_count; ++v) sum += corner[v].uv[0];
        }
    volatile float used = sum; // every corner was read
    (void)used;
    kiln_level_close(level);
    return faults;
}

Bytes small_level(std::uint8_t encoding = 0) { return write_level(test::mixture(3, 6, encoding)); }

} // namespace

TEST(LevelHostile, EveryTruncationIsRefused) {
    const Bytes good = small_level();
    for (std::size_t size = 0; size < good.size(); size += 97) {
        kiln_level* level = nullptr;
        const kiln_status status = kiln_level_open_memory(good.data(), size, &level);
        ASSERT_NE(status, KILN_OK) << size;
        ASSERT_EQ(level, nullptr);
        use_everything(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)));
    }
}

// A flip is found by a checksum, or hit the zeros between two lumps.
TEST(LevelHostile, EveryBitFlipIsFoundOrHarmless) {
    const Bytes good = small_level(1);
    std::vector<char> covered(good.size(), 0);
    const Level level(good);
    const std::size_t count = kiln_level_lump_count(level.get());
    std::fill_n(covered.begin(), kHeaderSize + count * kEntrySize, 1);
    for (std::size_t i = 0; i < count; ++i) {
        kiln_lump lump{};
        kiln_level_lump(level.get(), i, &lump);
        std::fill_n(covered.begin() + static_cast<std::ptrdiff_t>(lump.offset), lump.stored_size, 1);
    }
    std::mt19937_64 random(1);
    for (int i = 0; i < 2000; ++i) {
        Bytes bad = good;
        const std::size_t at = random() % bad.size();
        bad[at] ^= static_cast<std::uint8_t>(1u << random() % 8);
        kiln_level* damaged = nullptr;
        const kiln_status status = kiln_level_open_memory(bad.data(), bad.size(), &damaged);
        const bool found = status != KILN_OK || kiln_level_check(damaged, nullptr) != KILN_OK;
        kiln_level_close(damaged);
        ASSERT_EQ(found, covered[at] != 0) << at;
        if (i % 10 == 0) use_everything(bad);
    }
}

TEST(LevelHostile, AForgedCopyOfAGoodFileIsGood) {
    const Bytes forged = Forge(small_level()).bytes();
    EXPECT_EQ(use_everything(forged), 0);
}

// Damage inside the lumps with checksums made right again: the checks of the tables must hold alone.
TEST(LevelHostile, ForgedLumpsNeverCrash) {
    int faults = 0, rounds = 0;
    for (const std::uint8_t encoding : {std::uint8_t{0}, std::uint8_t{1}, std::uint8_t{2}}) {
        const Forge good(small_level(encoding));
        std::mt19937_64 random(encoding + 1u);
        for (int i = 0; i < 1000; ++i) {
            Forge bad = good;
            Forge::Lump& l = bad.lumps[random() % bad.lumps.size()];
            if (l.bytes.empty()) continue;
            for (int k = 0; k < 1 + i % 3; ++k) {
                const std::size_t at = i % 2 ? random() % l.bytes.size() : random() % std::min<std::size_t>(l.bytes.size(), 40);
                switch (random() % 3) {
                case 0: l.bytes[at] ^= static_cast<std::uint8_t>(1u << random() % 8); break;
                case 1: l.bytes[at] = random() % 2 ? 0xff : 0x80; break;
                default: l.bytes.resize(at + random() % 3); break;
                }
                if (l.bytes.empty()) break;
            }
            faults += use_everything(bad.bytes()), ++rounds;
        }
    }
    EXPECT_GT(faults, rounds / 4);
}

TEST(LevelHostile, CountsThatClaimTooMuchAreRefusedBeforeAllocation) {
    for (std::size_t field = 0; field < 23; ++field) {
        Forge bad(small_level());
        Bytes& head = bad["HEAD"].bytes;
        const std::uint32_t huge = 0xfffffff0u;
        std::memcpy(head.data() + 4 * field, &huge, 4);
        use_everything(bad.bytes());
    }
}

TEST(LevelHostile, ACompressionBombIsRefused) {
    Bytes zeros(std::size_t{64} << 20);
    Bytes packed(ZSTD_compressBound(zeros.size()));
    packed.resize(ZSTD_compress(packed.data(), packed.size(), zeros.data(), zeros.size(), 3));
    // The directory may claim what it likes: the frame says 64 MiB, the lump's table knows its own size.
    Forge bad(small_level());
    bad["NODE"].bytes = packed;
    Bytes file = bad.bytes();
    for (std::size_t i = 0; i < bad.lumps.size(); ++i) {
        if (bad.lumps[i].name() != "NODE") continue;
        const std::uint16_t zstd = KILN_CODEC_ZSTD;
        const std::uint64_t raw = std::uint64_t{1} << 40;
        std::memcpy(file.data() + kHeaderSize + i * kEntrySize + 10, &zstd, 2);
        std::memcpy(file.data() + kHeaderSize + i * kEntrySize + 32, &raw, 8);
    }
    Bytes hashed(file.begin(), file.begin() + 24);
    hashed.insert(hashed.end(), file.begin() + kHeaderSize, file.begin() + static_cast<std::ptrdiff_t>(kHeaderSize + bad.lumps.size() * kEntrySize));
    const std::uint64_t hash = XXH3_64bits(hashed.data(), hashed.size());
    std::memcpy(file.data() + 24, &hash, 8);
    const Level level(file);
    EXPECT_EQ(kiln_level_nodes(level.get(), nullptr), nullptr);
    for (std::size_t i = 0; i < bad.lumps.size(); ++i)
        EXPECT_EQ(kiln_level_load(level.get(), i, nullptr), bad.lumps[i].name() == "NODE" ? KILN_TOO_LARGE : KILN_OK);
    EXPECT_FALSE(level.leaves().empty()); // the others stay usable
}

TEST(LevelHostile, UnknownLumpsAreSkippedAndUnknownVersionsSaidSo) {
    Forge file(small_level());
    Forge::Lump extra = file["META"];
    std::memcpy(extra.entry.data(), "ZZZZ", 4);
    file.lumps.insert(file.lumps.begin(), extra);
    const std::uint16_t version = 2;
    std::memcpy(file["LITE"].entry.data() + 8, &version, 2);
    const Bytes bytes = file.bytes();
    const Level level(bytes);
    EXPECT_EQ(kiln_level_load(level.get(), 0, nullptr), KILN_OK);
    EXPECT_TRUE(level.lights().empty());
    EXPECT_EQ(kiln_level_check(level.get(), nullptr), KILN_UNSUPPORTED);
    EXPECT_FALSE(level.faces().empty());
}

TEST(LevelHostile, LoopsInTreesEnd) {
    LevelContent c = test::constant_room({1, 1, 1});
    c.nodes[3].child = {1, 1}, c.nodes[1].child = {3, 3};
    std::array<std::array<Float3, 6>, 8> corners{};
    test::add_air(c, corners);
    c.cubes.tree = {1, 1, 1, 1, 1, 1, 1, 1, 1};
    const auto bytes = write_level(c);
    const Level level(bytes);
    EXPECT_EQ(kiln_level_find_leaf(level.get(), std::array{0.0, 0.0, 0.0}.data()), KILN_NO_INDEX);
    float cube[6][3];
    EXPECT_EQ(kiln_level_ambient(level.get(), std::array{0.0, 0.0, 0.0}.data(), cube), KILN_NONE);
}

namespace {
kiln_status fall(const Level& level, double half, kiln_trace* trace) {
    const double start[3] = {0, 0, 100}, end[3] = {0, 0, -100}, mins[3] = {-half, -half, -half}, maxs[3] = {half, half, half};
    return kiln_trace_box(level.get(), start, end, mins, maxs, KILN_MASK_PLAYERS, trace);
}
} // namespace

TEST(LevelHostile, DamagedCollisionStopsTracesNotTheRest) {
    LevelContent c = test::constant_room({1, 1, 1});
    test::add_brush(c);
    const Bytes good = write_level(c);
    kiln_trace trace{};
    ASSERT_EQ(fall(Level(good), 8, &trace), KILN_OK);
    EXPECT_DOUBLE_EQ(trace.end[2], 16 + 8 + KILN_TRACE_DISTANCE);
    const auto spoil = [&](const char* lump, std::size_t at, double value) {
        Forge bad(good);
        std::memcpy(bad[lump].bytes.data() + at, &value, 8);
        return bad.bytes();
    };
    // One brush, one bevel: its count, then normal x, y, z and distance.
    for (const std::size_t at : {0u, 4u, 12u, 20u, 28u})
        for (const double value : {double(NAN), double(INFINITY), 1e301}) {
            const Bytes bad = spoil("BEVL", at, value);
            const Level level(bad);
            EXPECT_EQ(fall(level, 8, &trace), KILN_DAMAGED) << at;
            EXPECT_EQ(fall(level, 0, &trace), KILN_DAMAGED);
            EXPECT_EQ(level.brushes().size(), 1u);
            EXPECT_EQ(kiln_level_brush_bevels(level.get(), 0, nullptr), nullptr);
        }
    LevelContent loop = c;
    loop.nodes[3].child = {1, 1};
    const Bytes looped = write_level(loop);
    EXPECT_EQ(fall(Level(looped), 8, &trace), KILN_DAMAGED);
    std::mt19937_64 random(5);
    for (int i = 0; i < 2000; ++i) {
        Forge bad(good);
        const char* names[] = {"BEVL", "BRSH", "PLNS", "NODE", "LEAF"};
        Bytes& l = bad[names[i % 5]].bytes;
        l[random() % l.size()] = static_cast<std::uint8_t>(random());
        use_everything(bad.bytes());
    }
}

TEST(LevelHostile, DamagedCurvesStopTracesNotTheRest) {
    LevelContent c = test::constant_room({1, 1, 1});
    Displacement d;
    d.base = {Double3{-64, -64, 0}, {64, -64, 0}, {64, 64, 0}, {-64, 64, 0}};
    for (int i = 0; i < 25; ++i) d.positions.push_back({32.f * static_cast<float>(i % 5) - 64, 32.f * static_cast<float>(i / 5) - 64, 16}), d.alphas.push_back(0);
    d.triangle_tags.assign(32, 9);
    CurvedPatch p;
    p.columns = 3, p.rows = 2;
    for (int i = 0; i < 6; ++i) p.positions.push_back({32.f * static_cast<float>(i % 3), 32.f * static_cast<float>(i / 3), 32}), p.uv.push_back({0, 0});
    c.displacements = {d}, c.patches = {p};
    const Bytes good = write_level(c);
    kiln_trace trace{};
    ASSERT_EQ(fall(Level(good), 8, &trace), KILN_OK);
    EXPECT_DOUBLE_EQ(trace.end[2], 32 + 8 + KILN_TRACE_DISTANCE);
    EXPECT_EQ(trace.patch, 0u);
    // Vertices that are no places are not written...
    for (const char* lump : {"DISP", "CURV"})
        for (const float value : {NAN, INFINITY, -INFINITY, 1e30f, 0x1.000002p24f}) {
            LevelContent spoiled = c;
            (lump[0] == 'D' ? spoiled.displacements[0].positions : spoiled.patches[0].positions)[3][1] = value;
            EXPECT_ANY_THROW(write_level(spoiled)) << lump << ' ' << value;
        }
    // ... and not read: the columns of vertices, all bytes alike (3.4e38, and not a number), before the tags.
    for (const char* lump : {"DISP", "CURV"})
        for (const std::uint8_t byte : {0x7f, 0xff}) {
            Forge bad(good);
            Bytes& l = bad[lump].bytes;
            const std::size_t end = l.size() - (lump[0] == 'D' ? 32 * 2 : 0), size = lump[0] == 'D' ? 25 * 16 : 6 * 20;
            std::fill(l.begin() + static_cast<std::ptrdiff_t>(end - size), l.begin() + static_cast<std::ptrdiff_t>(end), byte);
            const Bytes bytes = bad.bytes();
            const Level level(bytes);
            EXPECT_EQ(fall(level, 8, &trace), KILN_DAMAGED);
            EXPECT_EQ(fall(level, 0, &trace), KILN_DAMAGED);
            EXPECT_EQ(kiln_level_check(level.get(), nullptr), KILN_DAMAGED);
            const void *displacements = kiln_level_displacements(level.get(), nullptr), *patches = kiln_level_curved_patches(level.get(), nullptr);
            EXPECT_EQ(lump[0] == 'D' ? displacements : patches, nullptr);
            EXPECT_NE(lump[0] == 'D' ? patches : displacements, nullptr); // the rest stays usable
        }
    for (const char* lump : {"DISP", "CURV", "MATL"}) { // cut short
        Forge bad(good);
        bad[lump].bytes.resize(bad[lump].bytes.size() / 2);
        const Bytes bytes = bad.bytes();
        EXPECT_EQ(fall(Level(bytes), 8, &trace), KILN_DAMAGED) << lump;
    }
    // Thin and empty grids.
    for (const auto [columns, rows] : {std::array{0u, 0u}, std::array{1u, 6u}, std::array{6u, 1u}, std::array{2u, 3u}}) {
        LevelContent thin = c;
        thin.patches[0].columns = columns, thin.patches[0].rows = rows;
        thin.patches[0].positions.resize(columns * rows), thin.patches[0].uv.resize(columns * rows);
        const Bytes bytes = write_level(thin);
        EXPECT_EQ(fall(Level(bytes), 8, &trace), KILN_OK) << columns;
    }
    std::mt19937_64 random(6);
    for (int i = 0; i < 4000; ++i) {
        Forge bad(good);
        const char* names[] = {"DISP", "CURV", "MATL", "HEAD"};
        Bytes& l = bad[names[i % 4]].bytes;
        for (int k = 0; k <= i % 3; ++k) l[random() % (i % 8 < 4 ? l.size() : std::min<std::size_t>(l.size(), 60))] = static_cast<std::uint8_t>(random());
        use_everything(bad.bytes());
    }
}

// Written before there were bevels: rays are traced, boxes are not traced wrongly.
TEST(LevelHostile, ALevelWithoutBevelsTracesRays) {
    LevelContent c = test::constant_room({1, 1, 1});
    test::add_brush(c);
    Forge old(write_level(c));
    std::erase_if(old.lumps, [](const Forge::Lump& l) { return l.name() == "BEVL" || l.name() == "BBLK"; });
    const Bytes bytes = old.bytes();
    const Level level(bytes);
    kiln_trace trace{};
    EXPECT_EQ(kiln_level_check(level.get(), nullptr), KILN_OK);
    EXPECT_EQ(fall(level, 8, &trace), KILN_MISSING);
    ASSERT_EQ(fall(level, 0, &trace), KILN_OK);
    EXPECT_DOUBLE_EQ(trace.end[2], 16 + KILN_TRACE_DISTANCE);
}

TEST(LevelHostile, NotALevel) {
    kiln_level* level = nullptr;
    EXPECT_EQ(kiln_level_open_memory("VBSP................................", 36, &level), KILN_NOT_A_LEVEL);
    EXPECT_EQ(kiln_level_open_memory("", 0, &level), KILN_NOT_A_LEVEL);
    EXPECT_EQ(kiln_level_open_memory(nullptr, 0, &level), KILN_BAD_ARGUMENT);
    Bytes newer = small_level();
    newer[4] = 2;
    EXPECT_EQ(kiln_level_open_memory(newer.data(), newer.size(), &level), KILN_UNSUPPORTED);
}

} // namespace kiln::level
