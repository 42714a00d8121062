// The ray scene and the patches.
#include "compiler/light/patches.h"
#include "libs/sampling/maps.h"
#include "tests/compiler/light/scenes.h"
#include <gtest/gtest.h>
#include <set>

using namespace kiln;
using namespace kiln::test;

TEST(TraceScene, HitsLieOnTheirFaceExactly) {
    const SurfacesBuilder b = two_rooms();
    const TraceScene scene(b.world, b.surfaces);
    const Sobol points(9);
    for (std::uint32_t i = 0; i < 4096; ++i) {
        const Vec3 o{40 + 100 * points(i, 2), 40 + 100 * points(i, 3), 80};
        const Vec3 d = uniform_sphere(points.pair(i, 0));
        const auto hit = scene.closest(o, d);
        ASSERT_TRUE(hit);
        const Face& f = b.surfaces.faces[hit->face.at()];
        EXPECT_NEAR(dot(f.normal, hit->position), f.distance, 1e-9);
        EXPECT_NEAR(length(hit->position - o), hit->distance, 1e-9);
        EXPECT_EQ(hit->back, dot(f.normal, d) > 0);
        EXPECT_FALSE(scene.occluded(o, o + d * (hit->distance * 0.999)));
        EXPECT_TRUE(scene.occluded(o, o + d * (hit->distance * 1.001 + 0.01)));
    }
}

// Bundles are only a faster way to ask: bit for bit the same.
TEST(TraceScene, BundlesEqualSingleRays) {
    const SurfacesBuilder b = two_rooms();
    const TraceScene scene(b.world, b.surfaces);
    const Sobol points(2);
    std::vector<Vec3> o, d;
    for (std::uint32_t i = 0; i < 4093; ++i) {
        o.push_back({10 + 300 * points(i, 2), 10 + 300 * points(i, 3), 1.0 / 256});
        d.push_back(cosine_hemisphere(points.pair(i, 0)));
    }
    std::vector<std::optional<SceneHit>> hits(o.size());
    scene.closest(o, d, hits);
    for (std::size_t i = 0; i < o.size(); ++i) {
        const auto single = scene.closest(o[i], d[i]);
        ASSERT_EQ(single.has_value(), hits[i].has_value());
        if (!single) continue;
        EXPECT_EQ(single->triangle, hits[i]->triangle);
        EXPECT_EQ(single->distance, hits[i]->distance);
    }
}

// So are rays to lights, from one place and from several, with some of no length and some to the sky among them.
TEST(TraceScene, RaysToLightsTogetherEqualSingleRays) {
    const SurfacesBuilder b = two_rooms();
    const TraceScene scene(b.world, b.surfaces);
    const Sobol points(5);
    std::size_t blocked = 0;
    for (const std::size_t count : {1u, 2u, 7u, 8u, 9u, 1021u})
        for (const bool sky : {false, true}) {
            std::vector<LightRay> rays;
            std::vector<Vec3> from, to;
            for (std::uint32_t i = 0; i < count; ++i) {
                LightRay ray{{10 + 300 * points(i, 0), 10 + 300 * points(i, 1), 1}, {10 + 300 * points(i, 2), 10 + 300 * points(i, 3), 100}};
                if (i % 16 == 11) ray.to = ray.from;
                from.push_back(ray.from), to.push_back(ray.to);
                if (sky && i % 5 == 3) ray.to = uniform_sphere(points.pair(i, 2)), ray.distant = true;
                rays.push_back(ray);
            }
            std::vector<Transmitted> together(3);
            scene.transmitted(rays, together);
            ASSERT_EQ(together.size(), count);
            std::vector<std::uint8_t> hidden(count);
            scene.occluded(from, to, hidden);
            for (std::size_t i = 0; i < count; ++i) {
                const Transmitted one = scene.transmitted(rays[i]);
                EXPECT_EQ(together[i].blocked, one.blocked) << i;
                EXPECT_EQ(together[i].share, one.share) << i;
                EXPECT_EQ(hidden[i] != 0, scene.occluded(from[i], to[i])) << i;
                blocked += one.blocked;
            }
        }
    EXPECT_GT(blocked, 100u);
}

// A closed room seen from inside, rays aimed at its edges and corners too: nothing escapes.
TEST(TraceScene, SharedVerticesHoldWater) {
    SurfacesBuilder b;
    const MaterialId m = b.material({0.5f, 0.5f, 0.5f});
    const Box3 box{{-331.7, 12.25, 7}, {100.1, 977.3, 311.9}};
    b.room(box, all(m));
    const TraceScene scene(b.world, b.surfaces);
    Random random(3);
    for (int i = 0; i < 100000; ++i) {
        Vec3 o, t;
        const int aim = i % 3; // at a face, an edge, a corner
        for (std::size_t a = 0; a < 3; ++a) {
            o[a] = box.lo[a] + (0.1 + 0.8 * random()) * (box.hi[a] - box.lo[a]);
            t[a] = static_cast<int>(a) <= aim ? (random() < 0.5 ? box.lo[a] : box.hi[a])
                                              : box.lo[a] + random() * (box.hi[a] - box.lo[a]);
        }
        EXPECT_TRUE(scene.closest(o, normalize(t - o)).has_value()) << i;
    }
}

// The wall that stands on the floor of the two rooms cuts its patches: none reaches under it, and those at the wall
// belong to one room, whatever the size of patches.
TEST(Patches, AreCutWhereAWallStands) {
    const SurfacesBuilder b = two_rooms();
    const PieceEdges edges = piece_adjacency(b.surfaces);
    for (const double h : {20.0, 40.0, 80.0, 160.0}) {
        const PatchTable table = build_patches(b.world, b.surfaces, edges, h);
        std::vector<Box3> box(table.patches.size());
        for (std::size_t p = 0; p < table.patches.size(); ++p) {
            double area = 0;
            for (std::uint32_t k = table.first_piece[p]; k < table.first_piece[p + 1]; ++k) {
                const LuxelPiece& piece = b.surfaces.pieces[table.pieces[k]];
                const Chart& c = b.surfaces.charts[b.surfaces.faces[piece.face.at()].chart.at()];
                for (const Vec2 v : points_of(b.surfaces, piece))
                    box[p].add(world_from_luxel(b.surfaces, piece.face, v));
                area += polygon_area(points_of(b.surfaces, piece)) * c.luxel_size * c.luxel_size;
            }
            EXPECT_NEAR(area, table.patches[p].area, 1e-6 * area);
            const bool floor = b.surfaces.faces[table.patches[p].face.at()].normal.z > 0.5 && box[p].hi.z < 1;
            const bool door = box[p].hi.y > 120 && box[p].lo.y < 180;
            if (floor && !door) {
                EXPECT_TRUE(box[p].hi.x <= 180 + 1e-6 || box[p].lo.x >= 190 - 1e-6) << h << " patch " << p;
            }
        }
        double all_area = 0, faces_area = 0;
        for (const Patch& p : table.patches) all_area += p.area;
        for (const Face& f : b.surfaces.faces) faces_area += f.area;
        EXPECT_NEAR(all_area, faces_area, 1e-6 * faces_area);
    }
}

// What is linear over a wall comes back at every luxel; each patch keeps its mean; next to a dark patch nothing falls below 0; and a patch without neighbours is constant.
TEST(Patches, ValuesAtLuxelsAreLinear) {
    const SurfacesBuilder b = furnace();
    const Surfaces& s = b.surfaces;
    const PieceEdges edges = piece_adjacency(s);
    const PatchTable table = build_patches(b.world, s, edges, 64);
    std::vector<std::uint32_t> luxel_patch;
    for (const Luxel& l : s.luxels) luxel_patch.push_back(table.piece_patch[l.first_piece]);
    Context context;
    const auto at_luxels = [&](const PatchTable& of, const std::vector<Rgbd>& values) {
        const std::size_t n = of.patches.size();
        const Grouped luxels(n, [&](const auto& add) {
            for (std::uint32_t l = 0; l < luxel_patch.size(); ++l) add(luxel_patch[l], l);
        });
        return values_at_luxels(s, neighbours_of(touching_patches(edges, of), n), luxels, values, context);
    };
    const auto linear = [](Vec3 x) { return Rgbd{5000 + x.x + 2 * x.y - 3 * x.z, 9000 - x.y, 4000}; };
    std::vector<Rgbd> values;
    for (const Patch& p : table.patches) values.push_back(linear(p.centroid));
    const std::vector<Rgbd> out = at_luxels(table, values);
    std::size_t looked_at = 0;
    for (std::size_t l = 0; l < s.luxels.size(); ++l) {
        const Chart& chart = s.charts[s.luxels[l].chart.at()];
        if (std::min(chart.width, chart.height) * chart.luxel_size < 129) continue; // no two patches along both axes
        ++looked_at;
        const Rgbd want = linear(world_from_luxel(s, s.luxels[l].face, centroid_of(s, s.luxels[l])));
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(out[l][c], want[c], 1.0) << l; // slopes of up to 3 over half a patch: 0.1 % of 96
    }
    EXPECT_GT(looked_at, 100u);
    std::vector<Rgbd> steep(values.size());
    for (std::size_t p = 0; p < steep.size(); ++p) steep[p] = p % 3 ? Rgbd{} : Rgbd{1, 7, 1e6};
    const std::vector<Rgbd> sharp = at_luxels(table, steep);
    std::vector<Rgbd> sum(values.size());
    std::vector<double> area(values.size());
    for (std::size_t l = 0; l < sharp.size(); ++l) {
        for (std::size_t c = 0; c < 3; ++c) EXPECT_GE(sharp[l][c], 0);
        sum[luxel_patch[l]] += sharp[l] * s.luxels[l].area, area[luxel_patch[l]] += s.luxels[l].area;
    }
    for (std::size_t p = 0; p < sum.size(); ++p)
        for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(sum[p][c], steep[p][c] * area[p], 1e-9 * (1 + steep[p][c]) * area[p]);
    const PatchTable faces = build_patches(b.world, s, edges, 65536);
    for (std::size_t l = 0; l < s.luxels.size(); ++l) luxel_patch[l] = faces.piece_patch[s.luxels[l].first_piece];
    std::vector<Rgbd> alone;
    for (std::size_t p = 0; p < faces.patches.size(); ++p) alone.push_back(Rgbd{1.0 * static_cast<double>(p), 2, 3});
    const std::vector<Rgbd> flat = at_luxels(faces, alone);
    for (std::size_t l = 0; l < flat.size(); ++l) EXPECT_EQ(flat[l], alone[luxel_patch[l]]);
}

// Every point of every face finds a patch, and the patch of the piece it lies in.
TEST(Patches, AreFoundFromPoints) {
    const SurfacesBuilder b = furnace();
    const PatchTable table = build_patches(b.world, b.surfaces, piece_adjacency(b.surfaces), 32);
    const LuxelIndex index(b.surfaces);
    for (std::size_t i = 0; i < b.surfaces.pieces.size(); ++i) {
        const LuxelPiece& piece = b.surfaces.pieces[i];
        Footprint f;
        f.add_piece(b.surfaces, piece);
        const Sobol points(i);
        for (std::uint32_t k = 0; k < 4; ++k)
            EXPECT_EQ(patch_at(index, table.texel_patch, table.piece_patch, table.face_patch,
                               piece.face, f.sample(points.pair(k, 0)).position),
                      table.piece_patch[i]);
    }
}
