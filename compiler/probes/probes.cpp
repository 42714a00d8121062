// The stage: places, renders, fits, assigns.
#include "compiler/light/memo.h"
#include "compiler/probes/probe_scene.h"
#include "libs/core/check.h"
#include "libs/core/hash.h"
#include "libs/parallel/parallel.h"
#include <bit>
#include <charconv>
#include <unordered_map>

namespace kiln {

namespace {

using namespace kiln::probes;

constexpr int kLargestSizeKey = 10; // 512 texels

struct Assigned { // probes, per face and leaf
    std::vector<std::uint32_t> face, leaf;
    template <class A> void fields(A& a) { a(face, leaf); }
};

std::uint32_t size_of(const World& world, EntityId e, const ProbesOptions& options, Context& context) {
    const auto standard = std::bit_floor(std::clamp(options.default_size, 1u, 4096u));
    const std::string_view text = world.entities[e.at()].get("cubemapsize");
    if (text.empty()) return standard;
    int n = -1;
    const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), n);
    if (fault != std::errc{} || end != text.data() + text.size() || n < 0 || n > kLargestSizeKey) {
        context.report(Severity::warning, "cubemap-size",
                       "cubemapsize \"" + std::string(text) + "\" is not one of 0 (default), 1..10 (2^(n-1) texels); " +
                           std::to_string(standard) + " texels are used",
                       world.location(e));
        return standard;
    }
    return n == 0 ? standard : 1u << (n - 1);
}

// Points just in front of a face: the middles of its largest triangles, and places near the corners of the two largest, as a
// face may see a probe from there only.
Receiver receiver_of(const Surfaces& surfaces, const Face& face, const Bsp& bsp, const PlaneTable& planes) {
    constexpr std::size_t kPoints = 6;
    constexpr std::size_t kWithCorners = 2;
    constexpr double kInwards = 0.1; // from the corner to the middle
    constexpr double kInFront = 0.5; // map units: clear of the face itself and of what lies flush with it
    Receiver receiver;
    receiver.normal = face.two_sided ? Vec3{} : face.normal;
    std::vector<std::pair<double, Vec3>> middles;
    std::vector<std::pair<double, std::array<Vec3, 3>>> triangles;
    for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t) {
        const auto& corners = surfaces.triangles[t];
        const Vec3 a = surfaces.positions[corners[0]], b = surfaces.positions[corners[1]], c = surfaces.positions[corners[2]];
        middles.emplace_back(-length(cross(b - a, c - a)), (a + b + c) / 3.0);
        triangles.push_back({middles.back().first, {a, b, c}});
    }
    const auto larger = [](const auto& a, const auto& b) { return a.first < b.first; };
    std::stable_sort(middles.begin(), middles.end(), larger);
    std::stable_sort(triangles.begin(), triangles.end(), larger);
    if (middles.size() == 2) // a rectangle: its middle says more
        receiver.points.push_back((middles[0].second + middles[1].second) * 0.5 + face.normal * kInFront);
    for (std::size_t i = 0; i < std::min(middles.size(), kPoints); ++i)
        receiver.points.push_back(middles[i].second + face.normal * kInFront);
    for (std::size_t i = 0; i < std::min(triangles.size(), kWithCorners); ++i)
        for (const Vec3& corner : triangles[i].second) receiver.points.push_back(corner + (middles[i].second - corner) * kInwards + face.normal * kInFront);
    for (const Vec3& p : receiver.points) {
        const LeafId leaf = leaf_at(bsp, planes, p);
        if (leaf.valid() && is_open(bsp.leaves[leaf.at()])) {
            receiver.leaf = leaf.value;
            break;
        }
    }
    return receiver;
}

Receiver receiver_of(const Bsp& bsp, const PlaneTable& planes, std::uint32_t l) {
    constexpr std::size_t kPoints = 4;
    Receiver receiver;
    receiver.leaf = l;
    const Box3& b = bsp.leaves[l].bounds;
    const auto take = [&](Vec3 p) {
        if (leaf_at(bsp, planes, p).value == l) receiver.points.push_back(p);
    };
    take(b.center());
    for (std::uint64_t i = 0; i < 32 && receiver.points.size() < kPoints; ++i) {
        Vec3 p;
        for (std::uint64_t a = 0; a < 3; ++a) p[a] = b.lo[a] + b.size()[a] * double(mix(i, a, std::uint64_t(l)) >> 11) * 0x1p-53;
        take(p);
    }
    if (receiver.points.empty()) receiver.points.push_back(b.center());
    return receiver;
}

} // namespace

Result<Probes> bake_probes(const World& world, const Bsp& bsp, const PlaneTable& planes, const Surfaces& surfaces,
                           const LightField& field, const ProbesOptions& options, Context& context, Memo* memo) {
    const ProbeScene scene = scene_of(surfaces, field);
    Probes out;
    out.face_probe.assign(surfaces.faces.size(), UINT32_MAX);
    out.leaf_probe.assign(bsp.leaves.size(), UINT32_MAX);
    std::vector<std::uint32_t> leaf_of_probe;
    const auto open_leaf = [&](Vec3 p) {
        const LeafId leaf = leaf_at(bsp, planes, p);
        return leaf.valid() && leaf.at() < bsp.leaves.size() && is_open(bsp.leaves[leaf.at()]) ? leaf.value : UINT32_MAX;
    };
    const auto add = [&](Vec3 position, EntityId entity, std::uint32_t size, std::uint32_t leaf) {
        Probe probe;
        probe.position = position, probe.entity = entity, probe.size = size;
        out.probes.push_back(probe);
        leaf_of_probe.push_back(leaf);
    };
    std::unordered_map<int, std::vector<std::uint32_t>> named; // side id of the map file: probes that list it
    for (std::uint32_t e = 0; e < world.entities.size(); ++e) {
        const WorldEntity& entity = world.entities[e];
        if (entity.get("classname") != "env_cubemap") continue;
        const EntityId entity_id = id<EntityId>(e);
        const std::uint32_t size = size_of(world, entity_id, options, context);
        const std::uint32_t leaf = entity.has_origin ? open_leaf(entity.origin) : UINT32_MAX;
        if (leaf == UINT32_MAX) {
            context.report(Severity::warning, "cubemap-in-solid",
                           entity.has_origin ? "the env_cubemap stands in solid or outside; it is left out: move it into the open"
                                             : "the env_cubemap has no origin; it is left out",
                           world.location(entity_id));
            continue;
        }
        const auto probe = static_cast<std::uint32_t>(out.probes.size());
        add(entity.origin, entity_id, size, leaf);
        const std::string_view sides = entity.get("sides");
        for (std::size_t at = 0; at < sides.size();) {
            int side = 0;
            const auto [end, fault] = std::from_chars(sides.data() + at, sides.data() + sides.size(), side);
            if (fault == std::errc{}) named[side].push_back(probe), at = static_cast<std::size_t>(end - sides.data());
            else ++at; // blanks between ids
        }
    }
    if (out.probes.empty()) {
        bool reflective = false;
        for (const Face& face : surfaces.faces)
            reflective = reflective || (face.drawn && face.material.valid() && world.materials[face.material.at()].env_map > 0);
        if (!reflective) return out;
        const auto place = default_place(world, bsp, planes, scene);
        if (!place) return out;
        add(*place, EntityId{}, std::bit_floor(std::clamp(options.default_size, 1u, 4096u)), open_leaf(*place));
    }
    for (std::size_t k = 0; k < out.probes.size(); ++k) {
        Probe& probe = out.probes[k];
        const std::uint64_t seed = mix(options.seed, std::bit_cast<std::uint64_t>(probe.position.x),
                                       std::bit_cast<std::uint64_t>(probe.position.y),
                                       std::bit_cast<std::uint64_t>(probe.position.z));
        probe.mips = mip_count(probe.size);
        probe.texels = prefilter(render(scene, probe.position, probe.size, options.supersample, seed, context),
                                 options.prefilter_samples, context);
        if (const auto box = fit_box(scene, probe.position)) probe.boxed = true, probe.box = *box;
        context.say("probes", double(k + 1) / double(out.probes.size()));
    }
    // Which of them a place takes depends on where they are and on geometry alone.
    ByteWriter places;
    for (const Probe& p : out.probes) places(p.position, p.boxed, p.box);
    if (memo) memo->begin();
    const auto assigned = known_or<Assigned>(memo, hash_bytes(places.bytes).low, [&] {
        Assigned of{out.face_probe, out.leaf_probe}; // none yet
        std::vector<std::vector<double>> ways(out.probes.size());
        parallel_for(context, out.probes.size(),
                     [&](std::size_t k) { ways[k] = ways_from(bsp, leaf_of_probe[k], out.probes[k].position); });
        const auto way = [&](std::uint32_t k, std::uint32_t leaf) { return ways[k][leaf]; };
        parallel_for(context, surfaces.faces.size(), [&](std::size_t f) {
            const Face& face = surfaces.faces[f];
            if (!face.drawn || face.sky || face.triangle_count == 0) return;
            Receiver receiver = receiver_of(surfaces, face, bsp, planes);
            if (face.side.valid() && world.format == MapFormat::vmf) // only there have sides ids of their own
                if (const auto at = named.find(world.sides[face.side.at()].id); at != named.end()) {
                    double nearest = 1e300;
                    for (const std::uint32_t k : at->second) { // several may name a side: the nearest
                        const Vec3 d = out.probes[k].position - receiver.points[0];
                        if (dot(d, d) < nearest) nearest = dot(d, d), receiver.explicit_probe = k;
                    }
                }
            of.face[f] = choose_probe(scene, out.probes, receiver, way);
        });
        parallel_for(context, bsp.leaves.size(), [&](std::size_t l) {
            if (!is_open(bsp.leaves[l]) || bsp.leaves[l].bounds.empty()) return;
            of.leaf[l] = choose_probe(scene, out.probes, receiver_of(bsp, planes, static_cast<std::uint32_t>(l)), way);
        });
        return of;
    });
    out.face_probe = assigned.face, out.leaf_probe = assigned.leaf;
    if (memo) memo->end();
    return out;
}

void validate(const Probes& probes) {
    for (const Probe& p : probes.probes) {
        KILN_CHECK(p.size > 0 && std::has_single_bit(p.size));
        KILN_CHECK_OP(p.mips, ==, mip_count(p.size));
        std::size_t texels = 0;
        for (std::uint32_t m = 0; m < p.mips; ++m) texels += std::size_t(6) * (p.size >> m) * (p.size >> m);
        KILN_CHECK_OP(p.texels.size(), ==, texels);
        for (const Rgb& t : p.texels) KILN_CHECK(std::isfinite(t.x) && std::isfinite(t.y) && std::isfinite(t.z));
        if (p.boxed)
            for (std::size_t a = 0; a < 3; ++a) KILN_CHECK(p.box.lo[a] <= p.position[a] && p.position[a] <= p.box.hi[a]);
    }
    for (const auto* list : {&probes.face_probe, &probes.leaf_probe})
        for (const std::uint32_t p : *list) KILN_CHECK(p == UINT32_MAX || p < probes.probes.size());
}

} // namespace kiln
