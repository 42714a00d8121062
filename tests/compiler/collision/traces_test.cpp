// Boxes swept through packed levels. Everything goes through the file and the C interface, as in a game.
#include "brushes.h"
#include "compiler/pack/pack.h"
#include "formats/level/kiln_level.hpp"
#include "tests/compiler/bsp/map_support.h"
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <optional>

namespace kiln::test {
namespace {

constexpr double kRest = KILN_TRACE_DISTANCE, kTouch = 1.0 / 1024;

// A level of geometry alone.
struct Arena {
    std::vector<std::uint8_t> bytes;
    std::optional<level::Level> level;

    explicit Arena(const World& world, const BspOptions& options = {}) {
        Context context;
        auto csg = build_csg(world, {}, context);
        auto bsp = build_bsp(world, *csg, options, context);
        Visibility visibility;
        visibility.cluster_count = bsp->cluster_count;
        visibility.rows.assign(std::size_t{bsp->cluster_count} * ((bsp->cluster_count + 63) / 64), 0);
        const Surfaces surfaces;
        const std::vector<Light> lights;
        const Lighting lighting;
        const Ambient ambient;
        const Probes probes;
        Result<Bytes> packed = pack({world, *csg, *bsp, visibility, surfaces, lights, lighting, ambient, probes, "{}", "", "test"}, {}, context);
        if (!packed) throw std::runtime_error(to_text(packed.fault().diagnostic)); // ends the test
        bytes = std::move(*packed);
        level.emplace(bytes);
        const char* what = nullptr;
        EXPECT_EQ(kiln_level_check(level->get(), &what), KILN_OK) << what;
    }
    kiln_trace trace(Vec3 start, Vec3 end, Vec3 mins, Vec3 maxs, std::uint32_t mask = KILN_MASK_PLAYERS) const {
        kiln_trace t{};
        EXPECT_EQ(kiln_trace_box(level->get(), &start.x, &end.x, &mins.x, &maxs.x, mask, &t), KILN_OK);
        return t;
    }
    kiln_trace trace(Vec3 start, Vec3 end, Vec3 half, std::uint32_t mask = KILN_MASK_PLAYERS) const {
        return trace(start, end, -half, half, mask);
    }
    kiln_trace of_model(std::uint32_t model, Vec3 origin, Vec3 start, Vec3 end, Vec3 mins, Vec3 maxs, std::uint32_t mask = KILN_MASK_PLAYERS) const {
        kiln_trace t{};
        EXPECT_EQ(kiln_trace_model(level->get(), model, &origin.x, &start.x, &end.x, &mins.x, &maxs.x, mask, &t), KILN_OK);
        return t;
    }
    kiln_trace posed(std::uint32_t model, const kiln_pose& pose, Vec3 start, Vec3 end, Vec3 mins, Vec3 maxs, std::uint32_t mask = KILN_MASK_PLAYERS) const {
        kiln_trace t{};
        EXPECT_EQ(kiln_trace_posed_model(level->get(), model, &pose, &start.x, &end.x, &mins.x, &maxs.x, mask, &t), KILN_OK);
        return t;
    }
    std::uint32_t contents(Vec3 p) const {
        std::uint32_t c = 0;
        EXPECT_EQ(kiln_point_contents(level->get(), &p.x, &c), KILN_OK);
        return c;
    }
    // How far the box reaches into the brush: < 0 outside, by a plane of it; own planes and bevels.
    double depth(std::uint32_t brush, Vec3 x, Vec3 mins, Vec3 maxs) const {
        double least = 1e30;
        const auto look = [&](const double* n, double distance) {
            double out = -distance;
            for (std::size_t k = 0; k < 3; ++k) out += n[k] * (x[k] + (n[k] < 0 ? maxs[k] : mins[k]));
            least = std::min(least, -out);
        };
        const kiln_brush& b = level->brushes()[brush];
        for (std::uint32_t i = b.first_plane; i < b.first_plane + b.plane_count; ++i) {
            const kiln_plane& p = level->planes()[level->brush_planes()[i]];
            look(p.normal, p.distance);
        }
        std::size_t n = 0;
        const kiln_bevel* bevels = kiln_level_brush_bevels(level->get(), brush, &n);
        for (std::size_t i = 0; i < n; ++i) look(bevels[i].normal, bevels[i].distance);
        return least;
    }
    double depth(Vec3 x, Vec3 mins, Vec3 maxs, std::uint32_t mask) const { // of the world's brushes
        double most = -1e30;
        for (std::uint32_t b = 0; b < level->brushes().size(); ++b)
            if (level->brushes()[b].model == 0 && mask >> level->brushes()[b].contents & 1) most = std::max(most, depth(b, x, mins, maxs));
        return most;
    }
};
Vec3 vec(const double (&v)[3]) { return {v[0], v[1], v[2]}; }

void expect_same(const kiln_trace& a, const kiln_trace& b) {
    EXPECT_EQ(a.fraction, b.fraction);
    EXPECT_EQ(vec(a.end), vec(b.end));
    EXPECT_EQ(vec(a.normal), vec(b.normal));
    EXPECT_EQ(a.distance, b.distance);
    EXPECT_EQ(a.contents, b.contents);
    EXPECT_EQ(a.brush, b.brush);
    EXPECT_EQ(a.side, b.side);
    EXPECT_EQ(a.start_solid, b.start_solid);
    EXPECT_EQ(a.all_solid, b.all_solid);
}

WorldBuilder room_with(auto&& more) {
    WorldBuilder w;
    w.room({-512, -512, 0}, {512, 512, 512});
    more(w);
    return w;
}
Vec3 random_vector(std::mt19937_64& rng, double r) { return {uniform(rng, -r, r), uniform(rng, -r, r), uniform(rng, -r, r)}; }

// ---- Models that have turned

struct HalfSpace {
    Vec3 normal;
    double distance;
};
// Whether an intersection of half-spaces holds any point: then it has a corner, where three of their planes meet.
bool holds_a_point(const std::vector<HalfSpace>& all, double slack) {
    for (std::size_t i = 0; i < all.size(); ++i)
        for (std::size_t j = i + 1; j < all.size(); ++j)
            for (std::size_t k = j + 1; k < all.size(); ++k) {
                const double volume = dot(all[i].normal, cross(all[j].normal, all[k].normal));
                if (std::abs(volume) < 1e-9) continue;
                const Vec3 p = (cross(all[j].normal, all[k].normal) * all[i].distance + cross(all[k].normal, all[i].normal) * all[j].distance +
                                cross(all[i].normal, all[j].normal) * all[k].distance) / volume;
                if (std::ranges::all_of(all, [&](const HalfSpace& h) { return dot(h.normal, p) <= h.distance + slack; })) return true;
            }
    return false;
}
Vec3 turned(const kiln_pose& pose, Vec3 v) { return vec(pose.turn[0]) * v.x + vec(pose.turn[1]) * v.y + vec(pose.turn[2]) * v.z; }
// A brush of a model where its pose has put it, grown by a box [x + mins, x + maxs] meeting it: the sides of both.
bool meet(const Arena& a, std::uint32_t brush, const kiln_pose& pose, Vec3 x, Vec3 mins, Vec3 maxs, double grow) {
    std::vector<HalfSpace> all;
    const kiln_brush& b = a.level->brushes()[brush];
    for (std::uint32_t i = b.first_plane; i < b.first_plane + b.plane_count; ++i) {
        const kiln_plane& p = a.level->planes()[a.level->brush_planes()[i]];
        const Vec3 n = turned(pose, vec(p.normal));
        all.push_back({n, p.distance - dot(vec(p.normal), vec(pose.pivot)) + dot(n, vec(pose.pivot) + vec(pose.origin))});
    }
    for (std::size_t k = 0; k < 3; ++k) {
        Vec3 n{};
        n[k] = 1;
        all.push_back({n, x[k] + maxs[k] + grow}), all.push_back({-n, -(x[k] + mins[k] - grow)});
    }
    return holds_a_point(all, 1e-7);
}
kiln_pose pose_of(Vec3 pivot, Vec3 origin, Vec3 angles) {
    kiln_pose p{{pivot.x, pivot.y, pivot.z}, {origin.x, origin.y, origin.z}, {}};
    kiln_turn_from_angles(&angles.x, p.turn);
    return p;
}

TEST(PosedTraces, AnglesTurnAsTheGamesTurn) {
    const auto forward = [](Vec3 angles) { return turned(pose_of({}, {}, angles), {1, 0, 0}); };
    const auto left = [](Vec3 angles) { return turned(pose_of({}, {}, angles), {0, 1, 0}); };
    EXPECT_EQ(forward({0, 90, 0}), (Vec3{0, 1, 0}));  // yaw: left
    EXPECT_EQ(forward({90, 0, 0}), (Vec3{0, 0, -1})); // pitch: down
    EXPECT_EQ(left({0, 0, 90}), (Vec3{0, 0, 1}));     // roll: the left side goes up
    EXPECT_EQ(forward({-450, 720, 0}), (Vec3{0, 0, 1}));
    EXPECT_NEAR(length(forward({30, 40, 50}) - Vec3{std::cos(M_PI / 6) * std::cos(M_PI * 2 / 9), std::cos(M_PI / 6) * std::sin(M_PI * 2 / 9), -0.5}), 0, 1e-12);
}

// A door of 64 x 8 turned by 45 degrees about its hinge: closed forms.
TEST(PosedTraces, ADoorThatStandsOpen) {
    const Arena a(room_with([](WorldBuilder& w) {
                      const ModelId door = w.model("func_door_rotating");
                      w.box({0, -4, 0}, {64, 4, 100}, Contents::solid, door);
                  }).world);
    const kiln_pose pose = pose_of({0, 0, 0}, {0, 0, 0}, {0, 45, 0});
    const Vec3 half{16, 16, 16}, n{std::sqrt(0.5), -std::sqrt(0.5), 0};
    // Against its middle from the right, straight along its normal: the box meets it with an edge, 16 sqrt 2 before its centre.
    const Vec3 middle = Vec3{32, 0, 50};
    const Vec3 at = turned(pose, middle), from = at + n * 200;
    const kiln_trace t = a.posed(1, pose, from, at, -half, half);
    EXPECT_NEAR(length(vec(t.normal) - n), 0, 1e-12);
    EXPECT_NEAR(length(vec(t.end) - at), 4 + 16 * std::sqrt(2.0) + kRest, 1e-9);
    EXPECT_NEAR(t.distance, 4, 1e-9);
    ASSERT_NE(t.brush, KILN_NO_INDEX);
    EXPECT_NE(t.side, KILN_NO_INDEX);
    // A point in it, and where it stood before it opened.
    std::uint32_t contents = 0;
    EXPECT_EQ(kiln_posed_model_point_contents(a.level->get(), 1, &pose, &at.x, &contents), KILN_OK);
    EXPECT_EQ(contents, static_cast<std::uint32_t>(KILN_CONTENTS_SOLID));
    EXPECT_EQ(kiln_posed_model_point_contents(a.level->get(), 1, &pose, &middle.x, &contents), KILN_OK);
    EXPECT_EQ(contents, 0u);
    // Down onto its corner edge at the top: a flat box on a flat top, whatever the turn.
    const kiln_trace down = a.posed(1, pose, at + Vec3{0, 0, 200}, at, -half, half);
    EXPECT_EQ(vec(down.normal), (Vec3{0, 0, 1}));
    EXPECT_NEAR(down.end[2], 100 + 16 + kRest, 1e-9);
}

TEST(PosedTraces, WithoutATurnTheyAreThoseOfModels) {
    std::mt19937_64 rng(3);
    for (int round = 0; round < 20; ++round) {
        WorldBuilder w;
        const ModelId model = w.model("func_rotating");
        random_hull(w, rng, {0, 0, 0}, 60, 3, Contents::solid, model);
        const Arena a(w.world);
        for (int i = 0; i < 200; ++i) {
            const Vec3 origin = random_vector(rng, 50), start = random_vector(rng, 200), end = random_vector(rng, 200), mins = random_vector(rng, 20) - Vec3{20, 20, 20};
            const Vec3 maxs = mins + random_vector(rng, 20) + Vec3{20, 20, 20};
            const kiln_trace t = a.posed(1, pose_of({7, 8, 9}, origin, {}), start, end, mins, maxs), plain = a.of_model(1, origin, start, end, mins, maxs);
            ASSERT_NEAR(t.fraction, plain.fraction, 1e-9);
            ASSERT_NEAR(length(vec(t.normal) - vec(plain.normal)), 0, 1e-6);
            ASSERT_NEAR(t.distance, plain.distance, 1e-6);
            ASSERT_EQ(t.brush, plain.brush);
            ASSERT_EQ(t.side, plain.side);
            ASSERT_EQ(t.start_solid, plain.start_solid);
            ASSERT_EQ(t.all_solid, plain.all_solid);
        }
    }
}

// Against brute force: the box never is in the brush, and where it is stopped the brush is near.
TEST(PosedTraces, AgreeWithBruteForce) {
    std::mt19937_64 rng(11);
    std::size_t stopped = 0, passed = 0, inside = 0;
    for (int round = 0; round < 40; ++round) {
        WorldBuilder w;
        const ModelId model = w.model("func_rotating");
        random_hull(w, rng, {0, 0, 0}, 60, 3, Contents::solid, model);
        const Arena a(w.world);
        for (int i = 0; i < 60; ++i) {
            const kiln_pose pose = pose_of(random_vector(rng, 60), random_vector(rng, 30), random_vector(rng, 180));
            const Vec3 middle = vec(pose.pivot) + vec(pose.origin) - turned(pose, vec(pose.pivot));
            const Vec3 start = middle + random_vector(rng, i % 10 == 0 ? 50 : 200), end = middle + random_vector(rng, 120), mins = random_vector(rng, 15) - Vec3{15, 15, 15};
            const Vec3 maxs = i % 4 == 0 ? mins : mins + random_vector(rng, 15) + Vec3{15, 15, 15};
            const kiln_trace t = a.posed(1, pose, start, end, mins, maxs);
            const bool starts_in = meet(a, 0, pose, start, mins, maxs, -2 * kTouch);
            if (t.start_solid || starts_in) {
                ++inside;
                if (starts_in) ASSERT_TRUE(t.start_solid);
                else ASSERT_TRUE(meet(a, 0, pose, start, mins, maxs, 1e-6));
                continue;
            }
            for (int s = 0; s <= 12; ++s) ASSERT_FALSE(meet(a, 0, pose, start + (vec(t.end) - start) * (s / 12.0), mins, maxs, -1e-6)) << round << " " << i;
            if (t.fraction == 1) {
                ++passed;
                continue;
            }
            ++stopped;
            // On to where it comes within half the rest of its plane; a box grown by a little then meets the brush.
            const Vec3 way = normalize(end - start);
            const double closing = -dot(way, vec(t.normal));
            ASSERT_GT(closing, 0);
            ASSERT_TRUE(meet(a, 0, pose, vec(t.end) + way * (kRest / 2 / closing), mins, maxs, 4 * kRest)) << round << " " << i;
        }
    }
    EXPECT_GT(stopped, 200u);
    EXPECT_GT(passed, 200u);
    EXPECT_GT(inside, 20u);
}

TEST(PosedTraces, WhatIsNoRotationIsRefused) {
    const Arena a(room_with([](WorldBuilder& w) { w.box({0, -4, 0}, {64, 4, 100}, Contents::solid, w.model("func_rotating")); }).world);
    const Vec3 from{-200, 0, 50}, to{200, 0, 50}, half{8, 8, 8}, low = -half;
    kiln_trace t{};
    const auto trace = [&](const kiln_pose& pose) { return kiln_trace_posed_model(a.level->get(), 1, &pose, &from.x, &to.x, &low.x, &half.x, KILN_MASK_PLAYERS, &t); };
    const kiln_pose good = pose_of({}, {}, {10, 20, 30});
    EXPECT_EQ(trace(good), KILN_OK);
    kiln_pose bad = good;
    for (double& x : bad.turn[1]) x = -x; // mirrored
    EXPECT_EQ(trace(bad), KILN_BAD_ARGUMENT);
    bad = good, bad.turn[0][0] *= 1.01;
    EXPECT_EQ(trace(bad), KILN_BAD_ARGUMENT);
    bad = good, bad.turn[2][1] = NAN;
    EXPECT_EQ(trace(bad), KILN_BAD_ARGUMENT);
    bad = good, bad.origin[0] = 1e9;
    EXPECT_EQ(trace(bad), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_trace_posed_model(a.level->get(), 2, &good, &from.x, &to.x, &low.x, &half.x, KILN_MASK_PLAYERS, &t), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_trace_posed_model(a.level->get(), 1, nullptr, &from.x, &to.x, &low.x, &half.x, KILN_MASK_PLAYERS, &t), KILN_BAD_ARGUMENT);
}

TEST(Traces, ABoxFallsToTheFloorAndSlidesThere) {
    const Arena a(room_with([](WorldBuilder&) {}).world);
    const Vec3 half{16, 16, 36};
    const kiln_trace fall = a.trace({0, 0, 200}, {0, 0, -200}, half);
    EXPECT_DOUBLE_EQ(fall.fraction, (200 - 36 - kRest) / 400);
    EXPECT_NEAR(fall.end[2], 36 + kRest, 1e-12);
    EXPECT_EQ(vec(fall.normal), (Vec3{0, 0, 1}));
    EXPECT_EQ(fall.distance, 0);
    EXPECT_EQ(fall.contents, static_cast<std::uint32_t>(KILN_CONTENTS_SOLID));
    ASSERT_LT(fall.side, a.level->brush_planes().size());
    EXPECT_EQ(a.level->planes()[a.level->brush_planes()[fall.side]].normal[2], 1);
    const kiln_trace along = a.trace(vec(fall.end), vec(fall.end) + Vec3{300, 200, 0}, half);
    EXPECT_EQ(along.fraction, 1);
    EXPECT_EQ(vec(along.end), vec(fall.end) + (Vec3{300, 200, 0}));
    EXPECT_EQ(along.brush, KILN_NO_INDEX);
    const kiln_trace ray = a.trace({0, 0, 100}, {2000, 0, 100}, {0, 0, 0});
    EXPECT_NEAR(ray.end[0], 512 - kRest, 1e-9);
    EXPECT_EQ(vec(ray.normal), (Vec3{-1, 0, 0}));
    EXPECT_EQ(ray.distance, -512);
    // Feet at the origin, as engines like it: only mins and maxs differ.
    const kiln_trace feet = a.trace({0, 0, 200}, {0, 0, -200}, {-16, -16, 0}, {16, 16, 72});
    EXPECT_NEAR(feet.end[2], kRest, 1e-12);
}

// What is tangent to a convex set never enters it: after one clip against a brush there is no second stop.
TEST(Traces, OneBrushStopsASlidingBoxOnce) {
    int stops = 0, bevels = 0;
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        std::mt19937_64 rng(seed);
        WorldBuilder w;
        random_hull(w, rng, {0, 0, 0}, uniform(rng, 20, 150));
        const Arena a(w.world);
        for (int i = 0; i < 400; ++i) {
            const Vec3 half{uniform(rng, 0, 40), uniform(rng, 0, 40), uniform(rng, 0, 60)};
            const Vec3 start = normalize(random_vector(rng, 1)) * uniform(rng, 300, 3000), target = random_vector(rng, 160);
            const Vec3 move = (target - start) * uniform(rng, 1, 2.5);
            const kiln_trace first = a.trace(start, start + move, half);
            ASSERT_FALSE(first.start_solid);
            if (first.fraction == 1) continue;
            ++stops, bevels += first.side == KILN_NO_INDEX;
            const Vec3 n = vec(first.normal), end = vec(first.end);
            ASSERT_NEAR(length(n), 1, 1e-12);
            Vec3 rest = move * (1 - first.fraction);
            rest = rest - n * dot(n, rest);
            // In one step, and in many small ones.
            const kiln_trace second = a.trace(end, end + rest, half);
            EXPECT_EQ(second.fraction, 1) << seed << ' ' << i;
            Vec3 at = end;
            for (int s = 0; s < 25; ++s) {
                const kiln_trace step = a.trace(at, at + rest * 0.04, half);
                ASSERT_EQ(step.fraction, 1) << seed << ' ' << i << ' ' << s;
                ASSERT_FALSE(step.start_solid);
                at = vec(step.end);
            }
            EXPECT_LT(length(at - (end + rest)), 1e-3);
            // Pushed against it, it stays where it is.
            const kiln_trace pushed = a.trace(end, end - n * 10, half);
            EXPECT_LT(pushed.fraction * 10, 1e-9);
        }
    }
    EXPECT_GT(stops, 1500);
    EXPECT_GT(bevels, 300);
}

// Quake's: clip against the planes met in this move, at most four; where two conflict, along their crease.
struct Walk {
    Vec3 at, velocity; // where it ends, what is left of its motion
    std::vector<Vec3> normals;
    bool stuck = false;
};
Walk slide(const Arena& a, Vec3 at, Vec3 move, Vec3 half, std::uint32_t mask = KILN_MASK_PLAYERS) {
    Walk w{at, move, {}, false};
    for (int bump = 0; bump < 4; ++bump) {
        const kiln_trace t = a.trace(w.at, w.at + w.velocity, half, mask);
        EXPECT_FALSE(t.start_solid);
        w.stuck = w.stuck || t.start_solid;
        w.at = vec(t.end);
        if (t.fraction == 1) return w;
        w.velocity = w.velocity * (1 - t.fraction);
        w.normals.push_back(vec(t.normal));
        const Vec3 before = w.velocity;
        std::size_t i = 0;
        for (; i < w.normals.size(); ++i) {
            const Vec3 v = before - w.normals[i] * dot(before, w.normals[i]);
            std::size_t j = 0;
            while (j < w.normals.size() && (j == i || dot(v, w.normals[j]) >= -1e-9)) ++j;
            if (j < w.normals.size()) continue;
            w.velocity = v;
            break;
        }
        if (i == w.normals.size()) {
            if (w.normals.size() != 2) return w;
            const Vec3 crease = normalize(cross(w.normals[0], w.normals[1]));
            w.velocity = crease * dot(crease, before);
        }
    }
    return w;
}

// Walls of bricks that abut in one plane, along directions whose planes are exact on the grid; pressed against them
// all the way, a box moves as along one wall: no brick's side ever stops it.
TEST(Traces, SeamsOfAWallDoNotShow) {
    std::mt19937_64 rng(17);
    for (const Vec2 along : {Vec2{5, 0}, Vec2{0, 5}, Vec2{4, 3}, Vec2{3, -4}, Vec2{4.8, 1.4}}) { // length 5
        const Vec2 into{-along.y / 5, along.x / 5}; // unit, into the wall
        WorldBuilder w;
        double s = -400;
        while (s < 400) {
            const double next = s + 5 * std::round(uniform(rng, 1, 12)), thick = 5 * std::round(uniform(rng, 1, 9));
            const auto corner = [&](double u, double v) { return Vec2{along.x / 5 * u + into.x * v, along.y / 5 * u + into.y * v}; };
            w.prism(std::vector<Vec2>{corner(s, 0), corner(next, 0), corner(next, thick), corner(s, thick)}, -100, 100);
            s = next;
        }
        const Arena a(w.world);
        for (int i = 0; i < 40; ++i) {
            const Vec3 half{uniform(rng, 1, 20), uniform(rng, 1, 20), uniform(rng, 1, 40)};
            const Vec3 u{along.x / 5, along.y / 5, 0}, v{into.x, into.y, 0};
            const double reach = std::fabs(v.x) * half.x + std::fabs(v.y) * half.y;
            Vec3 at = u * -300 - v * (reach + uniform(rng, 0.1, 30)) + Vec3{0, 0, uniform(rng, -40, 40)};
            const Vec3 from = at;
            const double speed = uniform(rng, 2, 20), press = uniform(rng, 0.01, 25), climb = uniform(rng, -0.1, 0.1);
            const int steps = static_cast<int>(500 / speed);
            int touched = 0;
            for (int k = 0; k < steps; ++k) {
                const Walk walk = slide(a, at, u * speed + v * press + Vec3{0, 0, climb}, half);
                ASSERT_FALSE(walk.stuck);
                for (const Vec3& n : walk.normals) ASSERT_LT(length(n + v), 1e-9) << "stopped by a seam at step " << k;
                touched += !walk.normals.empty();
                at = walk.at;
            }
            EXPECT_NEAR(dot(at - from, u), speed * steps, 1e-3);
            EXPECT_NEAR(at.z - from.z, climb * steps, 1e-3);
            if (touched) {
                // The last direction's corners are on no binary grid: canonicalisation makes the bricks' planes one, within its tolerance.
                EXPECT_NEAR(dot(at, v), -reach - kRest, along.x == 4.8 ? 1.0 / 64 : 1e-6);
            }
        }
    }
}

// Floors of tiles, a ramp out of tiles up to a platform: only the floor's, ramp's and platform's tops are ever met.
TEST(Traces, FloorsRampsAndPlatformsOfTilesAreSmooth) {
    WorldBuilder w;
    std::mt19937_64 rng(23);
    for (double y = -128; y < 128; y += 64)
        for (double x = -256; x < 256; x += 64) {
            const double z = x >= 64 ? 32 : 0; // platform
            w.box({x, y, -static_cast<double>(16 + rng() % 48)}, {x + 64, y + 64, z});
            if (x != 0) continue;
            for (const double s : {0.0, 32.0}) // the ramp, in two tiles a row: z = x / 2
                w.brush(std::vector<SidePoints>{{Vec3{s, y, s / 2}, {s, y + 64, s / 2}, {s + 32, y, s / 2 + 16}}, // top
                                                {Vec3{s, y, -8}, {s + 32, y, -8}, {s, y + 64, -8}},
                                                {Vec3{s, y, 0}, {s, y, 8}, {s + 32, y, 0}},
                                                {Vec3{s, y + 64, 0}, {s + 32, y + 64, 0}, {s, y + 64, 8}},
                                                {Vec3{s + 32, y, 0}, {s + 32, y, 8}, {s + 32, y + 64, 0}},
                                                {Vec3{s, y, 0}, {s, y + 64, 0}, {s, y, 8}}});
        }
    const Arena a(w.world);
    const Vec3 slope = normalize(Vec3{-1, 0, 2}), up{0, 0, 1};
    for (int i = 0; i < 60; ++i) {
        const Vec3 half{uniform(rng, 4, 20), uniform(rng, 4, 20), uniform(rng, 8, 36)};
        Vec3 at{-200, uniform(rng, -60, 0), half.z + uniform(rng, 0.05, 4)};
        const double speed = uniform(rng, 1, 9), side = uniform(rng, 0, 0.3) * speed, gravity = uniform(rng, 0.05, 2);
        bool met[2] = {};
        int k = 0;
        for (; k < 1000 && at.x < 200; ++k) {
            const Vec3 move{speed, side * (at.y < 60 ? 1 : 0), -gravity};
            const double before = at.x;
            const Walk walk = slide(a, at, move, half);
            ASSERT_FALSE(walk.stuck);
            for (const Vec3& n : walk.normals) {
                const bool ramp = length(n - slope) < 1e-9, flat = length(n - up) < 1e-9;
                ASSERT_TRUE(ramp || flat) << n.x << ' ' << n.y << ' ' << n.z << " at " << at.x << ' ' << at.y << ' ' << at.z;
                met[ramp] = true;
            }
            at = walk.at;
            // On the flat nothing is lost; on the slope the part along it is kept.
            const bool flat = walk.normals.empty() || (walk.normals.size() == 1 && walk.normals[0] == up);
            ASSERT_GT(at.x - before, flat ? speed - 1e-3 : speed * 0.5 - gravity);
        }
        EXPECT_LT(k, 1000);
        EXPECT_TRUE(met[0] && met[1]);
        const double above = a.trace(at, at - Vec3{0, 0, 20}, half).end[2] - 32 - half.z;
        EXPECT_TRUE(above > kRest / 2 - 1e-9 && above < kRest + 1e-9) << above;
    }
}

World soup(std::uint64_t seed, int count) {
    std::mt19937_64 rng(seed);
    WorldBuilder w;
    w.room({-600, -600, -600}, {600, 600, 600});
    constexpr Contents kinds[] = {Contents::solid, Contents::detail, Contents::clip, Contents::window, Contents::water, Contents::trigger, Contents::grate};
    for (int i = 0; i < count; ++i) random_hull(w, rng, random_point(rng, 550, 3), uniform(rng, 10, 90), 3, kinds[rng() % std::size(kinds)]);
    return w.world;
}

// Thousands of slides through a mess of brushes: never inside, never further than it tried, never not a number.
TEST(Traces, ASlidingBoxNeverGetsIn) {
    const Arena a(soup(31, 150));
    std::mt19937_64 rng(32);
    int walks = 0, stops = 0;
    for (int i = 0; i < 3000 && walks < 250; ++i) {
        const Vec3 half{uniform(rng, 0, 24), uniform(rng, 0, 24), uniform(rng, 0, 40)};
        Vec3 at = random_vector(rng, 590);
        if (a.depth(at, -half, half, KILN_MASK_HARD) > -kRest) continue;
        ++walks;
        Vec3 velocity = random_vector(rng, 60);
        for (int k = 0; k < 40; ++k) {
            const Walk walk = slide(a, at, velocity, half);
            ASSERT_FALSE(walk.stuck);
            ASSERT_LT(length(walk.at - at), length(velocity) * 4 + 1);
            at = walk.at;
            stops += static_cast<int>(walk.normals.size());
            if (walk.normals.size() > 2 || k % 9 == 8) velocity = random_vector(rng, 60);
        }
        ASSERT_LT(a.depth(at, -half, half, KILN_MASK_HARD), kTouch);
    }
    EXPECT_GT(walks, 100);
    EXPECT_GT(stops, 1000);
}

// Nothing is passed on the way, and what stops the box is there.
TEST(Traces, TheWayIsFreeAndItsEndIsNot) {
    const Arena a(soup(41, 150));
    std::mt19937_64 rng(42);
    int stopped = 0;
    for (int i = 0; i < 700; ++i) {
        const Vec3 mins = -Vec3{uniform(rng, 0, 24), uniform(rng, 0, 24), uniform(rng, 0, 40)}, maxs{uniform(rng, 0, 24), uniform(rng, 0, 24), 30};
        const Vec3 start = random_vector(rng, 590), end = start + random_vector(rng, i % 3 ? 200 : 3000);
        const kiln_trace t = a.trace(start, end, mins, maxs);
        const double depth = a.depth(start, mins, maxs, KILN_MASK_HARD);
        if (std::fabs(depth - kTouch) > 1e-6) {
            EXPECT_EQ(t.start_solid != 0, depth > kTouch);
        }
        ASSERT_TRUE(t.fraction >= 0 && t.fraction <= 1);
        if (t.start_solid) continue;
        for (int s = 0; s <= 20; ++s) ASSERT_LT(a.depth(start + (end - start) * (t.fraction * s / 20), mins, maxs, KILN_MASK_HARD), kTouch + 1e-9);
        if (t.fraction == 1) continue;
        ++stopped;
        // Where the moved plane is met: the box is in the brush's skin there, and kRest before it where it stopped.
        double at = -t.distance, way = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            at += t.normal[k] * (t.end[k] + (t.normal[k] < 0 ? maxs[k] : mins[k]));
            way += t.normal[k] * (end[k] - start[k]);
        }
        ASSERT_LT(way, 0);
        if (t.fraction > 0) {
            EXPECT_NEAR(at, kRest, 1e-8);
        }
        const Vec3 contact = vec(t.end) + (end - start) * ((at - kRest / 2) / -way);
        EXPECT_GT(a.depth(t.brush, contact, mins, maxs), -kRest / 2 - 1e-8);
    }
    EXPECT_GT(stopped, 200);
}

double cpu_seconds() { // of this thread: other work on the machine does not count
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void compare_with_every_brush(const Arena& a, int count, Vec3 lo, Vec3 hi, std::uint64_t seed) {
    std::mt19937_64 rng(seed);
    int stopped = 0, in_solid = 0, free = 0;
    a.trace({}, {}, {}); // decodes the lumps
    enum { steps, rays, far, huge };
    double by_tree_s[4] = {}, by_all_s[4] = {}, number[4] = {};
    for (int i = 0; i < count && !testing::Test::HasFailure(); ++i) {
        const auto place = [&] { return Vec3{uniform(rng, lo.x, hi.x), uniform(rng, lo.y, hi.y), uniform(rng, lo.z, hi.z)}; };
        const Vec3 start = place();
        Vec3 end = i % 4 == 0 ? place() : start + random_vector(rng, 256); // long diagonals, short steps
        if (i % 5 == 0) end[rng() % 3] = start[rng() % 3];
        if (i % 17 == 0) end = start;
        Vec3 mins = -Vec3{16, 16, 24}, maxs{16, 16, 32};
        if (i % 3 == 1) mins = maxs = {};
        if (i % 3 == 2) mins = -Vec3{uniform(rng, 0, 40), uniform(rng, 0, 40), uniform(rng, 0, 40)}, maxs = -mins * uniform(rng, 0, 2);
        if (i % 50 == 7) mins = {-700, -700, -700}, maxs = {700, 700, 700}; // larger than rooms
        constexpr std::uint32_t masks[] = {KILN_MASK_PLAYERS, KILN_MASK_BULLETS, KILN_CONTENTS_SOLID, 0xffffff, KILN_MASK_LIQUID, KILN_CONTENTS_TRIGGER};
        const std::uint32_t mask = masks[i % 11 < 6 ? i % 11 : 0];
        const double t0 = cpu_seconds();
        const kiln_trace tree = a.trace(start, end, mins, maxs, mask);
        const double t1 = cpu_seconds();
        const kiln_trace all = a.of_model(0, {}, start, end, mins, maxs, mask);
        const int kind = i % 50 == 7 ? huge : i % 4 == 0 ? far : i % 3 == 1 ? rays : steps;
        by_tree_s[kind] += t1 - t0, by_all_s[kind] += cpu_seconds() - t1;
        ++number[kind];
        expect_same(tree, all);
        stopped += tree.fraction < 1 && tree.fraction > 0, in_solid += tree.start_solid != 0, free += tree.fraction == 1;
        std::uint32_t by_tree = 0, by_all = 0;
        const Vec3 none{};
        EXPECT_EQ(kiln_point_contents(a.level->get(), tree.end, &by_tree), KILN_OK);
        EXPECT_EQ(kiln_model_point_contents(a.level->get(), 0, &none.x, tree.end, &by_all), KILN_OK);
        EXPECT_EQ(by_tree, by_all);
    }
    for (const int kind : {steps, rays, far, huge}) {
        constexpr const char* names[] = {"boxes, up to 440 units", "rays, up to 440 units", "boxes and rays across the level", "boxes larger than rooms"};
        std::printf("%-32s %9.0f traces a second by the tree, %9.0f over all %zu brushes\n", names[kind], number[kind] / by_tree_s[kind],
                    number[kind] / by_all_s[kind], a.level->brushes().size());
    }
    EXPECT_GT(stopped, count / 50);
    EXPECT_GT(in_solid, count / 50);
    EXPECT_GT(free, count / 50);
}

TEST(Traces, TheTreeLeavesNothingOut) {
    const Arena a(soup(51, 200));
    compare_with_every_brush(a, 5000, {-700, -700, -700}, {700, 700, 700}, 52);
}

// KILN_TRACES=100000 makes it thorough, and a benchmark.
class RealMapTraces : public testing::TestWithParam<const char*> {};
TEST_P(RealMapTraces, TheTreeLeavesNothingOut) {
    Context context;
    const auto world = real_world(std::string(KILN_SOURCE_DIR "/../shared/maps/") + GetParam(), context);
    if (!world) GTEST_SKIP() << GetParam() << " is not here";
    const Arena a(*world);
    Box3 box;
    for (const kiln_leaf& l : a.level->leaves()) box.add(Vec3{l.lo[0], l.lo[1], l.lo[2]}), box.add(Vec3{l.hi[0], l.hi[1], l.hi[2]});
    const char* wanted = std::getenv("KILN_TRACES");
    compare_with_every_brush(a, wanted ? std::atoi(wanted) : 1000, box.lo, box.hi, 61);
}
std::string map_name(const testing::TestParamInfo<const char*>& info) {
    std::string name = info.param;
    name = name.substr(name.rfind('/') + 1);
    for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
    return name;
}
INSTANTIATE_TEST_SUITE_P(Maps, RealMapTraces,
                         testing::Values("id-quake-map-source/e1m1.map", "id-quake-map-source/start.map", "librequake/lq_e1m5.map"), map_name);

// The floor of a room is the top of a brush: points on it are in it. Corners and edges as well.
TEST(Traces, PointContents) {
    const Arena a(room_with([](WorldBuilder& w) {
                      w.box({-64, -64, 0}, {64, 64, 64}, Contents::water);
                      w.box({0, 0, 32}, {128, 128, 128}, Contents::detail);
                      w.box({-512, -512, 256}, {512, 512, 512}, Contents::trigger);
                  }).world);
    EXPECT_EQ(a.contents({-32, -32, 16}), static_cast<std::uint32_t>(KILN_CONTENTS_WATER));
    EXPECT_EQ(a.contents({32, 32, 48}), static_cast<std::uint32_t>(KILN_CONTENTS_WATER | KILN_CONTENTS_DETAIL));
    EXPECT_EQ(a.contents({-32, -32, 0}), static_cast<std::uint32_t>(KILN_CONTENTS_WATER | KILN_CONTENTS_SOLID));
    EXPECT_EQ(a.contents({200, 200, 100}), 0u);
    EXPECT_EQ(a.contents({200, 200, 300}), static_cast<std::uint32_t>(KILN_CONTENTS_TRIGGER));
    EXPECT_EQ(a.contents({0, 0, -8}), static_cast<std::uint32_t>(KILN_CONTENTS_SOLID));
    EXPECT_EQ(a.contents({0, 0, -5000}), 0u);
    EXPECT_EQ(a.contents({128, 128, 128}), static_cast<std::uint32_t>(KILN_CONTENTS_DETAIL));
}

TEST(Traces, OutOfSolidButNotThroughIt) {
    const Arena a(room_with([](WorldBuilder& w) { w.box({-64, -64, 100}, {64, 64, 200}); }).world);
    const Vec3 half{8, 8, 8};
    const kiln_trace inside = a.trace({0, 0, 150}, {10, 0, 150}, half);
    EXPECT_TRUE(inside.start_solid && inside.all_solid);
    EXPECT_EQ(inside.fraction, 0);
    EXPECT_EQ(vec(inside.end), (Vec3{0, 0, 150}));
    EXPECT_EQ(inside.contents, static_cast<std::uint32_t>(KILN_CONTENTS_SOLID));
    const kiln_trace out = a.trace({0, 0, 150}, {200, 0, 150}, half);
    EXPECT_TRUE(out.start_solid && !out.all_solid);
    EXPECT_EQ(out.fraction, 1);
    const kiln_trace wall = a.trace({0, 0, 150}, {5000, 0, 150}, half);
    EXPECT_TRUE(wall.start_solid);
    EXPECT_NEAR(wall.end[0], 512 - 8 - kRest, 1e-8);
    const kiln_trace nowhere = a.trace({0, 0, 150}, {0, 0, 150}, half);
    EXPECT_TRUE(nowhere.all_solid);
    // A box larger than the room starts in all of its walls.
    EXPECT_TRUE(a.trace({0, 0, 256}, {100, 0, 256}, {600, 600, 600}).start_solid);
}

// Put down by hand exactly on the floor, or a rounding into it, a box walks, over seams too; and is stopped going down.
TEST(Traces, ABoxPutDownByHandWalks) {
    const Arena a(room_with([](WorldBuilder& w) { w.box({-64, -64, 0}, {0, 64, 32}), w.box({0, -64, 0}, {64, 64, 32}); }).world);
    const Vec3 half{8, 8, 16};
    for (const double lift : {0.0, 1e-9, -1e-9, 0.01, -0.0009}) {
        const Vec3 at{-40, 0, 32 + 16 + lift};
        const kiln_trace walk = a.trace(at, at + Vec3{80, 0, 0}, half);
        EXPECT_FALSE(walk.start_solid) << lift;
        EXPECT_EQ(walk.fraction, 1) << lift;
        const kiln_trace down = a.trace(at, at + Vec3{80, 0, -1}, half);
        EXPECT_EQ(down.fraction, 0) << lift;
        EXPECT_EQ(vec(down.normal), (Vec3{0, 0, 1})) << lift;
        EXPECT_EQ(a.trace(at, at + Vec3{0, 0, 5}, half).fraction, 1) << lift;
    }
    EXPECT_TRUE(a.trace({-40, 0, 32 + 16 - 0.01}, {40, 0, 48}, half).start_solid);
}

TEST(Traces, NothingTunnels) {
    const Arena a(room_with([](WorldBuilder& w) { w.box({100, -512, 0}, {100.25, 512, 512}); }).world); // a sheet of a quarter unit
    for (const double length : {10., 1e3, 1e5, 1e7}) {
        const kiln_trace t = a.trace({0, 3, 250}, {length + 100.5, 7, 251}, {0, 0, 0});
        EXPECT_NEAR(t.end[0], 100 - kRest, 1e-6);
    }
}

TEST(Traces, ModelsAreWhereTheirOriginIs) {
    WorldBuilder w;
    w.room({-512, -512, 0}, {512, 512, 512});
    const ModelId door = w.model("func_door"), trigger = w.model("trigger_multiple");
    w.tetrahedron({Vec3{0, 0, 0}, {64, 24, 8}, {8, 64, 24}, {24, 8, 64}}, Contents::solid, door);
    w.box({-32, -32, -32}, {32, 32, 32}, Contents::trigger, trigger);
    w.tetrahedron({Vec3{0, 0, 0}, {64, 24, 8}, {8, 64, 24}, {24, 8, 64}}, Contents::trigger, trigger);
    const Arena a(w.world);
    std::mt19937_64 rng(71);
    int hits = 0;
    for (int i = 0; i < 500; ++i) {
        const Vec3 origin = on_grid(uniform(rng, -200, 200), 3) * Vec3{1, 1, 0.5}, half{8, 8, 8};
        const Vec3 start = random_vector(rng, 250), end = random_vector(rng, 120);
        const kiln_trace here = a.of_model(door.value, {}, start, end, -half, half);
        const kiln_trace there = a.of_model(door.value, origin, start + origin, end + origin, -half, half);
        EXPECT_NEAR(here.fraction, there.fraction, 1e-9);
        EXPECT_LT(length(vec(here.normal) - vec(there.normal)), 1e-12);
        EXPECT_LT(length(vec(here.end) + origin - vec(there.end)), 1e-6);
        if (here.fraction == 1) continue;
        ++hits;
        EXPECT_NEAR(there.distance, here.distance + dot(vec(here.normal), origin), 1e-9);
        EXPECT_EQ(here.brush, 6u);
    }
    EXPECT_GT(hits, 30);
    // The world's traces do not see models; triggers are looked for by their contents.
    EXPECT_EQ(a.trace({-100, 20, 20}, {100, 21, 20}, {4, 4, 4}).fraction, 1);
    EXPECT_EQ(a.of_model(trigger.value, {0, 0, 256}, {-100, 0, 256}, {100, 0, 256}, {-4, -4, -4}, {4, 4, 4}).fraction, 1);
    const kiln_trace touch = a.of_model(trigger.value, {0, 0, 256}, {-100, 0, 256}, {100, 0, 256}, {-4, -4, -4}, {4, 4, 4}, KILN_CONTENTS_TRIGGER);
    EXPECT_NEAR(touch.end[0], -36 - kRest, 1e-9);
    std::size_t bevels = 0;
    kiln_level_brush_bevels(a.level->get(), 8, &bevels);
    EXPECT_GT(bevels, 6u) << "brushes of triggers are swept against too";
    std::uint32_t contents = 0;
    const Vec3 origin{0, 0, 256}, at{30, 30, 280};
    EXPECT_EQ(kiln_model_point_contents(a.level->get(), trigger.value, &origin.x, &at.x, &contents), KILN_OK);
    EXPECT_EQ(contents, static_cast<std::uint32_t>(KILN_CONTENTS_TRIGGER));
}

TEST(Traces, MasksChoose) {
    const Arena a(room_with([](WorldBuilder& w) {
                      const auto sheet = [&](double x, Contents contents, int blocks) {
                          w.world.brushes[w.box({x, -512, 0}, {x + 10, 512, 512}, contents).at()].blocks = static_cast<std::uint8_t>(blocks);
                      };
                      sheet(50, Contents::clip, kBlocksNpcs);
                      sheet(100, Contents::clip, kBlocksPlayers | kBlocksNpcs);
                      sheet(200, Contents::grate, kBlocksPlayers | kBlocksNpcs);
                      sheet(300, Contents::window, kBlocksAll & ~kBlocksSight);
                  }).world);
    const auto stop = [&](std::uint32_t mask) { return std::round(a.trace({0, 0, 100}, {1000, 0, 100}, {0, 0, 0}, mask).end[0]); };
    EXPECT_EQ(stop(KILN_MASK_PLAYERS), 100);
    EXPECT_EQ(stop(KILN_MASK_NPCS), 50);
    EXPECT_EQ(stop(KILN_MASK_HARD), 50);
    EXPECT_EQ(stop(KILN_MASK_BULLETS), 300);
    EXPECT_EQ(stop(KILN_MASK_SIGHT), 512);
    EXPECT_EQ(stop(KILN_CONTENTS_GRATE), 200);
    EXPECT_EQ(stop(KILN_CONTENTS_GRATE | KILN_FOR_SIGHT), 1000);
    EXPECT_EQ(stop(0), 1000);
}

TEST(Traces, BadArgumentsAreToldNotTraced) {
    const Arena a(room_with([](WorldBuilder&) {}).world);
    const kiln_level* l = a.level->get();
    const double zero[3] = {}, one[3] = {1, 1, 1}, nan[3] = {NAN, 0, 0}, far[3] = {1e9, 0, 0}, inf[3] = {0, INFINITY, 0};
    kiln_trace t{};
    for (const double* bad : {nan, far, inf}) {
        EXPECT_EQ(kiln_trace_box(l, bad, zero, zero, zero, 1, &t), KILN_BAD_ARGUMENT);
        EXPECT_EQ(kiln_trace_box(l, zero, bad, zero, zero, 1, &t), KILN_BAD_ARGUMENT);
        EXPECT_EQ(kiln_trace_box(l, zero, zero, zero, bad, 1, &t), KILN_BAD_ARGUMENT);
        EXPECT_EQ(kiln_trace_model(l, 0, bad, zero, zero, zero, zero, 1, &t), KILN_BAD_ARGUMENT);
        std::uint32_t c = 0;
        EXPECT_EQ(kiln_point_contents(l, bad, &c), KILN_BAD_ARGUMENT);
    }
    EXPECT_EQ(kiln_trace_box(l, zero, zero, one, zero, 1, &t), KILN_BAD_ARGUMENT); // mins > maxs
    EXPECT_EQ(kiln_trace_box(l, zero, zero, zero, zero, 1, nullptr), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_trace_box(nullptr, zero, zero, zero, zero, 1, &t), KILN_BAD_ARGUMENT);
    EXPECT_EQ(kiln_trace_model(l, 7, zero, zero, zero, zero, zero, 1, &t), KILN_BAD_ARGUMENT);
}

} // namespace
} // namespace kiln::test
