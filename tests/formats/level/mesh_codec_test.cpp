#include "formats/level/mesh_codec.h"
#include <gtest/gtest.h>
#include <map>
#include <random>

namespace kiln::level {
namespace {

// Numbers vertices by first use and drops triangles with coinciding corners, as the writer does.
GridMesh canonical(const GridMesh& in) {
    GridMesh out;
    std::map<std::array<std::int32_t, 3>, std::uint32_t> number;
    for (const auto& t : in.triangles) {
        const auto& a = in.positions[t[0]], &b = in.positions[t[1]], &c = in.positions[t[2]];
        if (a == b || b == c || c == a) continue;
        std::array<std::uint32_t, 3> to{};
        for (std::size_t k = 0; k < 3; ++k) {
            const auto [it, fresh] = number.try_emplace(in.positions[t[k]], static_cast<std::uint32_t>(out.positions.size()));
            if (fresh) out.positions.push_back(in.positions[t[k]]);
            to[k] = it->second;
        }
        out.triangles.push_back(to);
    }
    return out;
}

void expect_back(const GridMesh& mesh, bool draco) {
    const Blob bytes = encode_mesh(mesh);
    EXPECT_EQ(bytes[0], draco ? 1 : 0);
    const auto back = decode_mesh(bytes, static_cast<std::uint32_t>(mesh.positions.size()),
                                  static_cast<std::uint32_t>(mesh.triangles.size()));
    EXPECT_EQ(back, mesh);
    const Blob plain = encode_mesh(mesh, MeshCodec::plain);
    EXPECT_EQ(decode_mesh(plain, static_cast<std::uint32_t>(mesh.positions.size()),
                          static_cast<std::uint32_t>(mesh.triangles.size())),
              mesh);
}

GridMesh sheet(int n, std::uint32_t seed) {
    std::mt19937 random(seed);
    GridMesh mesh;
    for (int y = 0; y <= n; ++y)
        for (int x = 0; x <= n; ++x) mesh.positions.push_back({x * 64, y * 64, static_cast<std::int32_t>(random() % 40)});
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            const auto a = static_cast<std::uint32_t>(y * (n + 1) + x), b = a + 1, c = a + static_cast<std::uint32_t>(n) + 1, d = c + 1;
            mesh.triangles.push_back({a, b, d}), mesh.triangles.push_back({d, c, a});
        }
    std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
    return canonical(mesh);
}

} // namespace

TEST(LevelMesh, ASheetComesBackExactlyThroughDraco) { expect_back(sheet(40, 1), true); }

// Draco's default path reorders, turns, splits and drops; whatever it does, what was written comes back.
TEST(LevelMesh, TriangleSoupWithSharedEdgesTwinsAndFinsComesBack) {
    for (std::uint32_t seed = 1; seed < 30; ++seed) {
        std::mt19937 random(seed);
        GridMesh mesh;
        const std::uint32_t vertices = 5 + static_cast<std::uint32_t>(random()) % 30;
        for (std::uint32_t i = 0; i < vertices; ++i)
            mesh.positions.push_back({static_cast<std::int32_t>(random() % 7) - 3, static_cast<std::int32_t>(random() % 7),
                                      static_cast<std::int32_t>(random() % 3) * 100000});
        for (int i = 0; i < 120; ++i)
            mesh.triangles.push_back({static_cast<std::uint32_t>(random()) % vertices, static_cast<std::uint32_t>(random()) % vertices,
                                      static_cast<std::uint32_t>(random()) % vertices});
        mesh.triangles.push_back(mesh.triangles[3]); // the same twice, and its back
        mesh.triangles.push_back({mesh.triangles[3][0], mesh.triangles[3][2], mesh.triangles[3][1]});
        mesh = canonical(mesh);
        const Blob bytes = encode_mesh(mesh);
        EXPECT_EQ(decode_mesh(bytes, static_cast<std::uint32_t>(mesh.positions.size()), static_cast<std::uint32_t>(mesh.triangles.size())), mesh);
    }
}

TEST(LevelMesh, NothingAndOneTriangle) {
    expect_back({}, false);
    expect_back({{{0, 0, 0}, {100, 0, 0}, {0, 100, 0}}, {{0, 1, 2}}}, true);
}

TEST(LevelMesh, WrongCountsAreDamage) {
    const GridMesh mesh = sheet(8, 3);
    const Blob bytes = encode_mesh(mesh);
    const auto v = static_cast<std::uint32_t>(mesh.positions.size()), t = static_cast<std::uint32_t>(mesh.triangles.size());
    EXPECT_THROW(decode_mesh(bytes, v + 1, t), Damaged);
    EXPECT_THROW(decode_mesh(bytes, v, t - 1), Damaged);
    EXPECT_THROW(decode_mesh(bytes, v, 0xffffffffu), Damaged);
    EXPECT_THROW(decode_mesh(std::span(bytes).first(bytes.size() - 1), v, t), Damaged);
}

// Draco takes damaged streams for good ones now and then: what it gives must still be checked.
TEST(LevelMesh, MutatedStreamsNeverCrash) {
    const GridMesh mesh = sheet(12, 4);
    const Blob good = encode_mesh(mesh);
    std::mt19937 random(5);
    for (int i = 0; i < 1500; ++i) {
        Blob bad = good;
        for (int k = 0; k < 1 + i % 4; ++k) bad[random() % bad.size()] ^= static_cast<std::uint8_t>(1u << random() % 8);
        try {
            const GridMesh out = decode_mesh(bad, static_cast<std::uint32_t>(mesh.positions.size()), static_cast<std::uint32_t>(mesh.triangles.size()));
            for (const auto& t : out.triangles)
                for (const std::uint32_t v : t) ASSERT_LT(v, out.positions.size());
        } catch (const std::exception&) {
        }
    }
}

} // namespace kiln::level
