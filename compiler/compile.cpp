#include "compiler/compile.h"
#include "compiler/density/shown_error.h"
#include "compiler/light/memo.h"
#include "compiler/stage.h"
#include "compiler/visibility/shut.h"
#include "libs/parallel/parallel.h"
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace kiln {
namespace {

// What geometry depends on: brushes, sides, materials; not where in the text they stand, not what entities say.
Hash geometry_key(const World& world) {
    ByteWriter w;
    for (const WorldSide& s : world.sides)
        w(s.points, s.material, s.texture, s.lightmap_scale, s.smoothing_groups, s.displacement, s.no_dynamic_shadow, s.editor_vertices);
    for (const WorldBrush& b : world.brushes)
        w(b.first_side, b.side_count, b.contents, b.model, b.casts_light_shadow, b.draws, b.collides, b.blocks, b.displaced);
    for (const WorldBrush& b : world.brushes)
        if (b.contents == Contents::occluder || b.contents == Contents::vis_cluster) w(b.entity); // those of one entity act together
    w(world.materials, world.format, world.model_count);
    return hash_bytes(w.bytes);
}
// What says of an entity whether its brushes and patches are panes, and how much they hide (world/panes.h).
void write_pane_keys(ByteWriter& w, const World& world, EntityId id) {
    for (const char* key : {"_shadow", "vrad_brush_cast_shadows", "rendermode", "renderamt", "alpha", "_alpha"}) w(std::string(world.entities[id.at()].get(key)));
    w(id.value == 0);
}
// The grids of displacements and patches, which only surfaces are made from; not where they stand.
Hash curves_key(const World& world) {
    ByteWriter w;
    for (const WorldDisplacement& d : world.displacements) {
        const DocDisplacement& g = d.grid;
        w(d.side, g.power, g.start, g.elevation, g.normals, g.offsets, g.distances, g.alphas);
    }
    for (const WorldPatch& p : world.patches) {
        const DocPatch& g = p.grid;
        w(p.model, p.material, p.lightmap_scale, g.columns, g.rows, g.points, g.uv, g.subdivisions);
        write_pane_keys(w, world, p.entity);
    }
    return hash_bytes(w.bytes);
}
// Where in the text brushes and sides stand: only diagnostics show it.
Hash places_key(const World& world) {
    ByteWriter w;
    w(world.file, world.included);
    for (const WorldSide& s : world.sides) w(s.line, s.id);
    for (const WorldDisplacement& d : world.displacements) w(d.grid.line);
    for (const WorldPatch& p : world.patches) {
        const WorldEntity& e = world.entities[p.entity.at()];
        w(p.grid.line, p.grid.id, p.file, e.line, e.id);
    }
    for (const WorldEntity& e : world.entities)
        if (equal_ignoring_case(e.get("classname"), "sky_camera")) w(e.line, e.id, e.file);
    for (const WorldBrush& b : world.brushes) {
        const WorldEntity& e = world.entities[b.entity.at()];
        w(b.line, b.id, b.file, e.line, e.id);
    }
    return hash_bytes(w.bytes);
}
Hash entity_lines_key(const World& world) { // what the messages of stages that read entities show
    ByteWriter w;
    for (const WorldEntity& e : world.entities) w(e.line, e.id, e.file);
    return hash_bytes(w.bytes);
}
Hash sky_key(const World& world) { // where 3D skies are, and where players start, which tells whether they are rooms of their own
    ByteWriter w;
    const auto name = [](const WorldEntity& e) { return lower_case(e.get("classname")); };
    if (std::ranges::any_of(world.entities, [&](const WorldEntity& e) { return e.has_origin && name(e) == "sky_camera"; }))
        for (const WorldEntity& e : world.entities)
            if (e.has_origin && (name(e) == "sky_camera" || name(e).starts_with("info_player"))) w(name(e), e.origin);
    for (const WorldBrush& b : world.brushes) // what messages of area portals, occluders and clusters show
        if (b.contents == Contents::area_portal || b.contents == Contents::occluder || b.contents == Contents::vis_cluster) {
            const WorldEntity& e = world.entities[b.entity.at()];
            w(std::string(e.get("classname")), std::string(e.get("targetname")), e.line, e.id);
        }
    return hash_bytes(w.bytes);
}
Hash smoothing_key(const World& world) { // keys of entities that steer surfaces
    ByteWriter w;
    for (const WorldBrush& b : world.brushes) {
        const WorldEntity& e = world.entities[b.entity.at()];
        for (const char* key : {"_phong", "_phong_angle", "_phong_angle_concave", "_phong_group"}) w(std::string(e.get(key)));
        write_pane_keys(w, world, b.entity);
    }
    return hash_bytes(w.bytes);
}
// Overlays lie on surfaces and change nothing else of them.
Hash overlays_key(const World& world) {
    ByteWriter w;
    w(world.overlays);
    for (const WorldOverlay& o : world.overlays) {
        const WorldEntity& e = world.entities[o.entity.at()];
        w(world.name_of(e.file), e.line, e.id); // what the messages show
    }
    return hash_bytes(w.bytes);
}
// The surfaces that light falls on: moving an overlay lights nothing anew.
Hash without_overlays(Surfaces& s, Hash all_of_it) {
    if (s.overlay_fragments.empty()) return all_of_it;
    auto fragments = std::exchange(s.overlay_fragments, {});
    auto points = std::exchange(s.overlay_points, {});
    const Hash hash = hash_of(s);
    s.overlay_fragments = std::move(fragments), s.overlay_points = std::move(points);
    return hash;
}
// What light reads of panes beside surfaces: what their materials let through, where their textures lie, and what their entities say of shadows
// and opacity.
Hash panes_key(const World& world, const Surfaces& s) {
    const auto entity = [&](ByteWriter& w, EntityId id) {
        if (id.valid()) write_pane_keys(w, world, id);
    };
    ByteWriter w;
    w(world.format);
    for (const Material& m : world.materials) {
        w(m.flags, m.alpha, m.alpha_stated, m.tint, m.opacity_map, m.width, m.height);
        if (m.flags & kTranslucent) w(m.reflectance); // the hue of what passes, where no tint is stated
    }
    std::vector<std::uint8_t> done(world.brushes.size());
    for (const Face& f : s.faces) {
        if (!f.drawn || !f.side.valid()) continue;
        const std::size_t b = world.brush_of(f.side).at();
        if (std::exchange(done[b], std::uint8_t{1})) continue;
        const WorldBrush& brush = world.brushes[b];
        const auto thin = [&](const WorldSide& side) {
            const Material& m = world.materials[side.material.at()];
            return (m.flags & (kTranslucent | kAlphaTested)) || m.alpha < 1;
        };
        const auto faded = [&](const WorldEntity& e) { return !e.get("rendermode").empty() || !e.get("alpha").empty() || !e.get("_alpha").empty(); };
        const std::span sides(world.sides.data() + brush.first_side, brush.side_count);
        if (std::ranges::none_of(sides, thin) && !(brush.entity.valid() && faded(world.entities[brush.entity.at()]))) continue;
        entity(w, brush.entity);
        w(brush.contents, brush.model);
        for (const WorldSide& side : sides) w(side.points, side.material, side.texture);
    }
    for (const WorldPatch& p : world.patches) entity(w, p.entity), w(p.model);
    return hash_bytes(w.bytes);
}
Hash lights_key(std::vector<Light> lights) {
    for (Light& l : lights) l.entity = {}; // its number in the file does not light anything
    return hash_of(lights);
}
Hash probe_entities_key(const World& world, const Bsp& bsp) {
    ByteWriter w;
    // A map without probes gets one in the region of the first player start.
    for (const WorldEntity& e : world.entities)
        if (e.has_origin && e.get("classname").starts_with("info_player")) w(leaf_at(bsp, e.origin));
    for (std::size_t i = 0; i < world.entities.size(); ++i)
        if (equal_ignoring_case(world.entities[i].get("classname"), "env_cubemap")) w(i, world.entities[i].origin, world.entities[i].keys);
    for (const WorldSide& s : world.sides) w(s.id); // side lists name them
    return hash_bytes(w.bytes);
}

template <class... T> Hash all(const T&... parts) {
    ByteWriter w;
    w(parts...);
    return hash_bytes(w.bytes);
}

// `files`: of the bytes of all that were opened, in their order.
Result<Document> read_map(const CompileInput& input, const AssembleOptions& options, Hash& files, Context& context) {
    files = hash_bytes(input.map.bytes);
    const OpenMap open = [&](const std::string& wanted, const std::string& from) -> Result<TextFile> {
        if (!input.open) return fault(Exit::input, "cannot-read", "other maps are not read here");
        Result<TextFile> file = input.open(wanted, from);
        if (file) files = all(files, hash_bytes(file->bytes));
        return file;
    };
    return assemble(input.map, open, options, context);
}
Result<World> make_world(const Document& document, const CompileInput& input, const WorldOptions& options, Context& context) {
    MaterialDatabase materials;
    const auto text = [](const TextFile& f) {
        return std::string_view(reinterpret_cast<const char*>(f.bytes.data()), f.bytes.size());
    };
    for (const TextFile& f : input.lights_rad) materials.add_lights_rad(text(f), f.name, context);
    for (const TextFile& f : input.materials)
        if (auto added = materials.add_json(text(f), f.name, context); !added) return added.fault();
    return build_world(document, materials, options, context);
}
// Beyond the farz of fog nothing is drawn; as far as the farthest of them, where each controller has one.
double sight_radius(const World& world, Context& context) {
    double farthest = 0;
    EntityId found;
    for (std::size_t i = 0; i < world.entities.size(); ++i) {
        const WorldEntity& e = world.entities[i];
        if (!equal_ignoring_case(e.get("classname"), "env_fog_controller")) continue;
        const std::string_view text = e.get("farz");
        double farz = 0;
        if (const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), farz); error != std::errc{} || !(farz > 0) || !std::isfinite(farz)) return 0;
        if (farz > farthest) farthest = farz, found = id<EntityId>(i);
    }
    if (found.valid())
        context.report(Severity::note, "vis-radius", fmt::format("nothing is seen beyond {:g} map units, the farz of the fog (--vis-radius 0: no limit)", farthest), world.location(found));
    return farthest;
}
// The visibility stage, taken up where an earlier run was stopped; what it came to is kept where it is stopped again.
Result<Visibility> see(Hash key, std::span<const std::uint8_t> shut, const VisibilityOptions& options, const CompileRun& run, Context& context, Compiled& out) {
    const bool keeps = run.keeps() && !options.fast;
    const Hash place = all(std::string("visibility in progress, 5"), key);
    std::array<VisibilityProgress, 2> progress; // area portals open, and shut
    const auto begin = std::chrono::steady_clock::now();
    if (keeps)
        if (const auto bytes = run.store->load(place)) try {
                progress = from_bytes<std::array<VisibilityProgress, 2>>(bytes->bytes());
            } catch (const ArchiveError&) {
                progress = {};
            }
    const auto keep = [&] {
        if (keeps && progress[0].begun) (void)run.store->save(place, to_bytes(progress)); // not kept: the next run begins anew
    };
    try {
        auto v = compute_visibility(out.portals, out.bsp.cluster_count, options, context, {.seconds = run.visibility_seconds, .progress = &progress[0], .stopped = &out.visibility_stopped});
        if (v && !shut.empty()) {
            VisibilityOptions rest = options;
            if (rest.total_budget) rest.total_budget = std::max<std::uint64_t>(1, rest.total_budget - std::min(rest.total_budget, v->steps));
            const double left = run.visibility_seconds - std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
            bool stopped = false;
            auto rows = shut_rows(out.bsp, shut, *v, !out.visibility_stopped, rest, context,
                                  {.seconds = run.visibility_seconds > 0 ? std::max(left, 1e-6) : 0, .progress = &progress[1], .stopped = &stopped});
            if (!rows) return rows.fault();
            v->shut = *std::move(rows), out.visibility_stopped = out.visibility_stopped || stopped;
        }
        if (out.visibility_stopped) keep();
        if (v && !v->loose.empty()) {
            const VisPortal& p = out.portals[v->loose[0]];
            context.report(Severity::warning, "vis-budget",
                           fmt::format("{} of {} portals keep a loose set, the {} being used up; the first joins clusters {} and {} at {:g} {:g} {:g}; kiln vis --json lists them{}", v->loose.size(), out.portals.size(),
                                       out.visibility_stopped ? "time" : "budget of steps", p.cluster_front, p.cluster_back, p.winding[0].x, p.winding[0].y, p.winding[0].z,
                                       !out.visibility_stopped ? "" : keeps ? "; the same command goes on from here" : "; with --cache another run could go on from here"),
                           {.file = out.world.file});
        }
        return v;
    } catch (const Cancelled&) {
        keep();
        throw;
    }
}
constexpr std::uint32_t kLightVersion = 48, kAmbientVersion = 22, kProbesVersion = 5, kDensityVersion = 22, kLumpsVersion = 2;
// A stage that takes over from a memo what comes to the same as in an earlier run with other lights.
// Each table lies in the store by itself: most runs change small ones alone. make(whether there are memos)
template <class T, class Make> Result<T> with_memo(Hash place, const std::vector<Memo*>& memos, const CompileRun& run, Context& context, const Make& make) {
    if (!run.keeps()) return make(false);
    std::vector<std::pair<Memo::Table*, Hash>> tables;
    for (std::uint64_t m = 0; m < memos.size(); ++m)
        for (std::uint64_t t = 0; t < memos[m]->tables().size(); ++t) tables.emplace_back(&memos[m]->tables()[t], all(place, m, t));
    parallel_for(context, tables.size(), [&](std::size_t i) {
        if (auto bytes = run.store->load(tables[i].second)) try {
                *tables[i].first = Memo::Table::of(*std::move(bytes));
            } catch (const ArchiveError&) { // as good as absent
            }
    });
    Result<T> made = make(true);
    if (made)
        for (const auto& [table, at] : tables) // one after the other: each is copied
            if (table->changed) (void)run.store->save(at, to_bytes(*table), false); // not kept: the next run takes nothing over
    return made;
}
Result<Lighting> relight(Hash shape, Hash sight, const LightOptions& options, const Visibility* seen, const CompileRun& run, Context& context, const Compiled& out) {
    LightMemo memo;
    const auto rows_key = [&](Hash table) { return all(std::string("form factors"), kLightVersion, shape, table); };
    memo.load_rows = [&](Hash table) { return run.store->load(rows_key(table)); };
    memo.save_rows = [&](Hash table, Bytes rows) { (void)run.store->save(rows_key(table), rows, false); };
    return with_memo<Lighting>(all(std::string("light of before"), kLightVersion, shape, sight, options), memo.all(), run, context,
                               [&](bool kept) { return bake_light(out.world, out.bsp, out.bsp.planes, out.surfaces, out.lights, options, context, kept ? &memo : nullptr, seen); });
}
// The openings themselves were reported by the stage.
Fault leak_fault(const World& world, const Leak& leak) {
    const auto where = leak.entity.valid() ? world.location(leak.entity) : SourceLocation{.file = world.file};
    return fault(Exit::geometry, "leak",
                 "the world is not sealed, nothing was built; the way out is in the .pts and .lin files (--allow-leaks builds all the same)",
                 where);
}

} // namespace

Result<bool> compile(const CompileInput& input, const CompileOptions& options, const CompileRun& run, Context& context,
                     Compiled& out) try {
    StageRunner stages(run, context, out.stages);
    const auto done = [&](Stage stage) { return run.last == stage; };

    Hash files; // what the map was read from
    if (auto r = stages.run_always(Stage::read, out.document, [&] { return read_map(input, options.assemble, files, context); }); !r) return r;
    if (done(Stage::read)) return true;

    if (auto r = stages.run_always(Stage::world, out.world, [&] { return make_world(out.document, input, options.world, context); }); !r) return r;
    const World& world = out.world;
    const Hash geometry = geometry_key(world), places = places_key(world);
    if (done(Stage::world)) return true;

    const auto csg = stages.run(Stage::csg, 3, all(geometry, options.csg), places, out.csg,
                                [&] { return build_csg(world, options.csg, context); });
    if (!csg) return csg.fault();
    if (done(Stage::csg)) return true;

    BspOptions bsp_options = options.bsp;
    bsp_options.allow_leaks = false; // is for the leak test alone
    const auto make_bsp = [&] {
        return stages.run(Stage::bsp, 7, all(*csg, geometry, sky_key(world), bsp_options), places, out.bsp,
                          [&] { return build_bsp(world, out.csg, bsp_options, context); });
    };
    auto bsp = make_bsp();
    if (!bsp) return bsp.fault();
    auto leaks = find_leaks(world, out.csg, out.bsp, options.bsp, context); // the one thing here that asks for entities
    if (!leaks) return leaks.fault();
    out.leak = std::move(leaks->leak), out.leaks = std::move(leaks->leaks);
    if (out.leak && !options.bsp.allow_leaks) return leak_fault(world, *out.leak);
    if (out.leak) {
        bsp_options.fill = false;
        if (bsp = make_bsp(); !bsp) return bsp.fault();
    }
    out.portals = vis_portals(out.bsp);
    if (done(Stage::bsp)) return true;

    const auto surfaces = stages.run(Stage::surfaces, 12, all(*bsp, *csg, geometry, curves_key(world), smoothing_key(world), overlays_key(world), options.surfaces), places, out.surfaces,
                                     [&] { return build_surfaces(world, out.csg, out.bsp, options.surfaces, context); });
    if (!surfaces) return surfaces.fault();
    if (done(Stage::surfaces)) return true;

    VisibilityOptions sight = options.visibility;
    if (sight.radius < 0) sight.radius = sight_radius(world, context);
    const std::vector<std::uint8_t> shut = shut_leaves(out.csg, out.bsp);
    std::vector<std::uint32_t> areas; // of leaves and clusters, where there is anything to shut
    for (std::size_t l = 0; l < out.bsp.leaves.size() && !shut.empty(); ++l) areas.push_back(out.bsp.leaves[l].area), areas.push_back(out.bsp.leaves[l].cluster.value);
    if (!shut.empty())
        for (const AreaPortal& p : out.bsp.area_portals) areas.insert(areas.end(), p.areas.begin(), p.areas.end());
    const Hash seen_from = all(out.portals, out.bsp.cluster_count, sight, shut, areas);
    const auto visibility = stages.run(Stage::visibility, 6, seen_from, places, out.visibility, [&] { return see(seen_from, shut, sight, run, context, out); }, [&] { return !out.visibility_stopped; });
    if (!visibility) return visibility.fault();
    if (options.vis_merge >= 0) {
        out.merged = merge_clusters(out.visibility, out.bsp, options.vis_merge, context);
        context.report(Severity::note, "vis-merge", fmt::format("{} clusters are {} now; a leaf sees {:.1f} leaves on average, {:.1f} without", out.merged->of.size(), out.merged->visibility.cluster_count,
                                                                out.merged->mean_after, out.merged->mean_before), {.file = world.file});
    }
    if (done(Stage::visibility)) return true;

    out.lights = read_lights(world, context);
    if (out.lights.empty() && std::ranges::all_of(world.materials, [](const Material& m) { return m.emission == Rgb{}; }))
        context.report(Severity::warning, "no-lights", "nothing in the map gives light: the level will be black", {.file = world.file});
    // Light goes on in the fog; and it must not depend on how far visibility came in some time.
    const Visibility* seen = sight.radius > 0 || out.visibility_stopped ? nullptr : &out.visibility;
    const Hash seen_by = seen ? hash_of(seen->rows) : Hash{};
    const Hash shape = all(without_overlays(out.surfaces, *surfaces), *bsp, panes_key(world, out.surfaces)); // what rays meet, whatever shines
    const Hash lit = all(shape, seen_by, hash_of(world.materials), lights_key(out.lights));
    const auto light = stages.run(Stage::light, kLightVersion, all(lit, options.light), places, out.lighting,
                                  [&] { return relight(shape, seen_by, options.light, seen, run, context, out); });
    if (!light) return light.fault();
    if (done(Stage::light)) return true;

    // Built when a stage below asks for it; a warm build needs no ray scene.
    std::unique_ptr<LightField> built;
    const auto field = [&]() -> const LightField& {
        if (!built) built = std::make_unique<LightField>(world, out.bsp, out.bsp.planes, out.surfaces, out.lights, out.lighting, seen);
        return *built;
    };
    const auto ambient = stages.run(Stage::ambient, kAmbientVersion, all(lit, *light, options.ambient), places, out.ambient,
                                    [&] {
                                        Memo memo;
                                        return with_memo<Ambient>(all(std::string("cubes of before"), kAmbientVersion, field().scene().instruction_set(), shape, seen_by, options.light, options.ambient), {&memo}, run, context,
                                                                  [&](bool kept) { return place_ambient(out.bsp, out.bsp.planes, out.surfaces, out.lights, field(), options.ambient, context, kept ? &memo : nullptr); });
                                    });
    if (!ambient) return ambient.fault();
    if (done(Stage::ambient)) return true;

    const Hash probe_entities = probe_entities_key(world, out.bsp);
    const auto probes = stages.run(Stage::probes, kProbesVersion, all(lit, *light, probe_entities, options.probes), all(places, entity_lines_key(world)), out.probes,
                                   [&] {
                                       Memo memo;
                                       return with_memo<Probes>(all(std::string("probes of before"), kProbesVersion, field().scene().instruction_set(), shape, probe_entities, options.probes), {&memo}, run, context,
                                                                [&](bool kept) { return bake_probes(world, out.bsp, out.bsp.planes, out.surfaces, field(), options.probes, context, kept ? &memo : nullptr); });
                                   });
    if (!probes) return probes.fault();
    if (done(Stage::probes)) return true;

    const auto texels = [&](Memo* charts, Memo* shown) -> Result<Density> {
        Result<Density> made = level_texels(out.surfaces, out.lighting, options.density, context, charts);
        if (!made) return made;
        const auto off = shown_error(world, out.surfaces, out.lighting, *made, field(), {.error_floor = options.density.error_floor}, context, shown);
        if (!off) return off.fault();
        made->shown = *off;
        return made;
    };
    const auto density = stages.run(Stage::density, kDensityVersion, all(lit, *light, options.density), places, out.density,
                                    [&] {
                                        Memo charts, shown;
                                        return with_memo<Density>(all(std::string("charts of before"), kDensityVersion, field().scene().instruction_set(), shape, seen_by, options.light, options.density), {&charts, &shown}, run, context,
                                                                  [&](bool kept) { return kept ? texels(&charts, &shown) : texels(nullptr, nullptr); });
                                    });
    if (!density) return density.fault();
    if (done(Stage::density)) return true;

    const auto packed = stages.run_always(Stage::pack, out.level, [&]() -> Result<Bytes> {
        const PackInput content{world, out.csg, out.bsp, out.visibility, out.surfaces, out.lights, out.lighting, out.ambient, out.probes,
                                options_json(options), to_hex(all(files, hash_of(world.materials))), kVersion, &out.density, out.merged ? &*out.merged : nullptr};
        level::WriteOptions how{.zstd_level = options.zstd_level, .strip = options.strip};
        Memo lumps;
        return with_memo<Bytes>(all(std::string("lumps of before"), kLumpsVersion, shape, options.zstd_level), {&lumps}, run, context, [&](bool kept) {
            if (!kept) return pack(content, how, context);
            lumps.begin();
            how.known = [&](std::uint64_t key, const std::function<Bytes()>& make) { return known_or<Bytes>(&lumps, key, make); };
            Bytes level = pack(content, how, context);
            lumps.end();
            return level;
        });
    });
    if (!packed) return packed;
    return true;
} catch (const Cancelled&) {
    return fault(Exit::cancelled, "cancelled", "cancelled; nothing was written");
}

std::string options_json(const CompileOptions& o) {
    static constexpr const char* kEncodings[] = {"dot", "sq", "tilted"};
    static constexpr const char* kDirectional[] = {"needed", "all", "none"};
    nlohmann::ordered_json j = {
        {"world", {{"lightmap_scale", o.world.lightmap_scale}}},
        {"csg", {{"plane_merge_distance", o.csg.plane_merge_distance}, {"grid_bits", o.csg.grid_bits}}},
        {"bsp", {{"allow_leaks", o.bsp.allow_leaks}, {"micro_gap", o.bsp.micro_gap}}},
        {"visibility", {{"fast", o.visibility.fast}, {"epsilon", o.visibility.epsilon}, {"step_budget", o.visibility.step_budget}, {"total_budget", o.visibility.total_budget}, {"radius", o.visibility.radius}}},
        {"surfaces", {{"smoothing_angle_deg", o.surfaces.smoothing_angle_deg}, {"most_texels", o.surfaces.most_texels}, {"curve_flatness", o.surfaces.curve_flatness}}},
        {"light",
         {{"error_percent", o.light.error_percent}, {"encoding", kEncodings[static_cast<int>(o.light.encoding)]},
          {"directional", kDirectional[static_cast<int>(o.light.directional)]}, {"error_floor", o.light.error_floor}, {"seed", o.light.seed}, {"match_seams", o.light.match_seams}}},
        {"ambient",
         {{"error_percent", o.ambient.error_percent}, {"coarsest", o.ambient.coarsest}, {"finest", o.ambient.finest},
          {"local_lights", o.ambient.local_lights}, {"rays", o.ambient.rays}, {"lattice_offset", o.ambient.lattice_offset}, {"seed", o.ambient.seed}}},
        {"probes", {{"default_size", o.probes.default_size}, {"prefilter_samples", o.probes.prefilter_samples}, {"supersample", o.probes.supersample}, {"seed", o.probes.seed}}},
        {"pack", {{"zstd_level", o.zstd_level}, {"strip", o.strip}}},
        {"assemble", {{"cordon", o.assemble.cordon}}},
        {"density", {{"error_percent", o.density.error_percent}, {"error_floor", o.density.error_floor}}}};
    if (o.vis_merge >= 0) j["visibility"]["merge_percent"] = o.vis_merge;
    return j.dump();
}

} // namespace kiln
