#include "compiler/world/brush_box.h"
#include "compiler/world/contents.h"
#include "compiler/world/curves.h"
#include "compiler/world/entity_classes.h"
#include "compiler/world/omitted_layers.h"
#include "compiler/world/overlays.h"
#include "compiler/world/panes.h"
#include "compiler/world/regions.h"
#include "compiler/world/row_flags.h"
#include "compiler/world/side_list.h"
#include "compiler/world/world.h"
#include "libs/core/hash.h"
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <unordered_map>

namespace kiln {
namespace {

// Finer luxels than this are a slip of the hand: a room of 1000 units would have 64 million of them a wall.
constexpr double kFinestLightmapScale = 0.125, kCoarsestLightmapScale = 65536; // map units per luxel

struct Counted { // one diagnostic for many of a kind
    std::uint32_t count = 0;
    SourceLocation first;
    void add(SourceLocation where) {
        if (count++ == 0) first = std::move(where);
    }
};

class Builder {
public:
    Builder(const Document& document, MaterialDatabase& materials, const WorldOptions& options, Context& context)
        : document_(document), database_(materials), options_(options), context_(context),
          quake3_(means_quake3(document)) {
        world_.file = document.file;
        world_.included = document.included;
        world_.format = document.format;
    }

    Result<World> run() {
        if (document_.entities.empty())
            return fault(Exit::input, "no-entities", "the map has no entities", {document_.file, 1});
        world_scale_ = scale_of(document_.entities[0], options_.lightmap_scale);
        const std::vector<std::uint8_t> omitted = omitted_by_layer(document_);
        regions_ = find_regions(document_, omitted, context_);
        for (const DocEntity& e : document_.entities)
            if (equal_ignoring_case(e.get("classname"), "func_areaportalwindow") && !e.get("target").empty())
                portal_windows_.insert(lower_case(e.get("target")));
        reserve_room();
        for (std::size_t e = 0; e < document_.entities.size(); ++e) {
            context_.check_cancelled();
            const DocEntity& entity = document_.entities[e];
            if (omitted[e]) omitted_.add({document_.name_of(entity.file), entity.line, entity.id});
            if (omitted[e]) omitted_brushes_ += entity.brushes.size();
            if (omitted[e] && e > 0) continue;
            if (e > 0 && regions_.any() && !in_regions(entity)) {
                outside_region_.add({document_.name_of(entity.file), entity.line, entity.id});
                continue;
            }
            add_entity(entity, omitted[e] == 0);
        }
        finish_entities();
        read_overlays(world_, database_, context_);
        report_counts();
        bool any = false;
        for (const WorldBrush& b : world_.brushes)
            any = any || (b.model.value == 0 && (opaque(b.contents) || b.displaced));
        if (!any)
            return fault(Exit::geometry, "no-world-brushes",
                         "the world has no solid brush: there is nothing to compile",
                         {document_.file, document_.entities[0].line, document_.entities[0].id});
        return std::move(world_);
    }

private:
    const Document& document_;
    MaterialDatabase& database_;
    const WorldOptions& options_;
    Context& context_;
    const bool quake3_;
    World world_;
    double world_scale_ = 16;
    using MaterialKey = std::tuple<std::string, std::uint32_t, float, float>; // name, flags, emission, alpha
    std::map<MaterialKey, MaterialId> material_ids_;
    std::map<std::string, Counted, std::less<>> classes_;
    Counted skipped_, mixed_, origin_in_world_, omitted_, hidden_patches_, unknown_bits_, outside_region_;
    std::size_t omitted_brushes_ = 0, brushes_outside_region_ = 0;
    UnknownBits unknown_;
    Regions regions_;
    std::set<std::string, std::less<>> portal_windows_; // names that func_areaportalwindows target, lower case

    SourceLocation where(const DocEntity& e, const DocBrush& b) const {
        return {document_.name_of(b.file), b.line, e.id, b.id};
    }

    // The luxel size an entity asks for, or `otherwise`.
    double scale_of(const DocEntity& e, double otherwise) {
        for (const std::string_view name : {"_lightmap_scale", "_world_units_per_luxel", "lightmapscale"}) {
            const DocKey* key = e.find(name);
            // Quake 3's key of that name is a factor on the sample size.
            const double unit = quake3_ && name == "lightmapscale" ? 16 : 1;
            if (!key) continue;
            const std::optional<double> value = parse_number(key->value);
            if (value && *value > 0) return bounded(*value * unit, {document_.name_of(e.file), key->line, e.id});
            context_.report(Severity::warning, "lightmap-scale-invalid",
                            fmt::format("the key {} is no positive number; 16 is used", key->key),
                            {document_.name_of(e.file), key->line, e.id});
            return 16;
        }
        return otherwise;
    }
    double bounded(double scale, const SourceLocation& at) {
        const double kept = std::clamp(scale, kFinestLightmapScale, kCoarsestLightmapScale);
        if (kept != scale)
            context_.report(Severity::warning, "lightmap-scale-clamped",
                            fmt::format("a lightmap scale of {} units per luxel becomes {}", scale, kept), at);
        return kept;
    }

    // What the material of a side depends on.
    struct SideMaterial {
        std::string_view name;
        std::int64_t contents = 0, surface_flags = 0, value = 0;
        bool has_content_flags = false;
        friend bool operator==(const SideMaterial&, const SideMaterial&) = default;
        struct Hash {
            std::size_t operator()(const SideMaterial& m) const {
                return std::hash<std::string_view>()(m.name) ^ mix(m.contents, m.surface_flags, m.value, m.has_content_flags);
            }
        };
    };
    std::unordered_map<SideMaterial, MaterialId, SideMaterial::Hash> side_materials_; // only looked up in: its order shows nowhere
    std::vector<MaterialId> brush_materials_; // of the sides of the brush at hand
    std::vector<std::uint32_t> brush_flags_;

    MaterialId material_of(const DocEntity& e, const DocBrush& b, const DocSide& s) {
        const auto [it, added] = side_materials_.try_emplace({s.material, s.contents, s.surface_flags, s.value, s.has_content_flags});
        if (added) it->second = intern(s, {document_.name_of(b.file), s.line, e.id, b.id, s.id});
        return it->second;
    }
    MaterialId intern(const DocSide& side, const SourceLocation& where) {
        Material m = with_row_flags(database_.find(side.material, context_, where), side, document_.format, quake3_);
        const MaterialKey key{m.name, m.flags, m.emission.x, m.alpha};
        const auto [it, added] = material_ids_.try_emplace(key, id<MaterialId>(world_.materials.size()));
        if (added) world_.materials.push_back(std::move(m));
        return it->second;
    }

    void reserve_room() {
        std::size_t brushes = 0, sides = 0;
        for (const DocEntity& e : document_.entities) {
            brushes += e.brushes.size();
            for (const DocBrush& b : e.brushes) sides += b.sides.size();
        }
        world_.entities.reserve(document_.entities.size());
        world_.brushes.reserve(brushes);
        world_.sides.reserve(sides);
    }

    void add_entity(const DocEntity& e, bool with_brushes) {
        const std::size_t index = world_.entities.size();
        WorldEntity out;
        out.keys = e.keys;
        out.file = e.file;
        out.line = e.line;
        out.id = e.id;
        read_origin(e, out);
        const DocKey* classname = e.find("classname");
        if (!classname)
            context_.report(Severity::warning, "entity-without-class", "an entity has no classname",
                            {document_.name_of(e.file), e.line, e.id});
        else
            classes_[lower_case(classname->value)].add({document_.name_of(e.file), e.line, e.id});
        for (std::uint32_t i = 0; i < e.skipped_primitives; ++i) skipped_.add({document_.name_of(e.file), e.line, e.id});

        const BrushUse use = brush_use(e, index == 0, document_.format);
        const bool own_model = use == BrushUse::model || use == BrushUse::hidden_model || use == BrushUse::water;
        if (index == 0) out.model = id<ModelId>(0);
        const double scale = index == 0 ? world_scale_ : scale_of(e, world_scale_);
        if (with_brushes) {
            for (const DocBrush& b : e.brushes) {
                if (regions_.any() && is_region_brush(b)) continue;
                if (regions_.any() && !regions_.keeps(box_of(b))) {
                    ++brushes_outside_region_;
                    continue;
                }
                const std::size_t before = world_.brushes.size();
                add_brush(e, b, index, use, scale, out);
                if (own_model && world_.brushes.size() > before) {
                    if (!out.model.valid()) out.model = id<ModelId>(world_.model_count++);
                    world_.brushes.back().model = out.model;
                }
            }
            for (const DocPatch& p : e.patches) {
                Box3 box;
                for (const Vec3 v : p.points) box.add(v);
                if (regions_.any() && !regions_.keeps(box)) ++brushes_outside_region_;
                else add_patch(e, p, index, use, scale, out);
            }
            if (index == 0)
                for (const DocBrush& wall : regions_.walls) add_brush(e, wall, index, use, scale, out);
            if (use == BrushUse::ladder) become_info_ladder(e, out);
        }
        world_.entities.push_back(std::move(out));
    }

    // What is in no region goes: point entities by their origin, others with the last of their brushes.
    bool in_regions(const DocEntity& e) const {
        if (e.brushes.empty()) {
            const DocKey* origin = e.find("origin");
            return !origin || !e.patches.empty() || regions_.keeps(e.vector("origin", {}));
        }
        for (const DocBrush& b : e.brushes)
            if (is_region_brush(b) || regions_.keeps(box_of(b))) return true;
        return false;
    }

    // As in Source: the game finds ladders by their bounds.
    static void become_info_ladder(const DocEntity& e, WorldEntity& out) {
        Box3 box;
        for (const DocBrush& b : e.brushes)
            if (const Box3 own = box_of(b); !own.empty()) box.add(own);
        if (box.empty()) return;
        for (DocKey& k : out.keys)
            if (equal_ignoring_case(k.key, "classname")) k.value = "info_ladder";
        constexpr const char* kAxis[] = {"x", "y", "z"};
        for (const auto& [name, corner] : {std::pair{"mins", box.lo}, {"maxs", box.hi}})
            for (std::size_t i = 0; i < 3; ++i)
                out.keys.push_back({fmt::format("{}.{}", name, kAxis[i]), fmt::format("{}", corner[i] + 0.0), e.line});
    }

    // What entities say of things that stand elsewhere in the file.
    void finish_entities() {
        std::optional<SideNames> names;
        std::set<std::string, std::less<>> lighting;
        for (const WorldEntity& e : world_.entities)
            if (equal_ignoring_case(e.get("classname"), "info_lighting")) lighting.insert(lower_case(e.get("targetname")));
        for (std::size_t e = 0; e < world_.entities.size(); ++e) {
            const WorldEntity& entity = world_.entities[e];
            const std::string_view name = entity.get("classname");
            if (equal_ignoring_case(name, "info_no_dynamic_shadow")) {
                if (!names) names.emplace(world_);
                for (const SideId s : resolve_side_list(world_, *names, id<EntityId>(e), "sides", context_))
                    world_.sides[s.at()].no_dynamic_shadow = true;
            }
            if (!equal_ignoring_case(name, "prop_static")) continue;
            const DocKey* wanted = find_key(entity.keys, "lightingorigin");
            if (!wanted || wanted->value.empty() || lighting.contains(lower_case(wanted->value))) continue;
            SourceLocation where = world_.location(id<EntityId>(e));
            where.line = wanted->line;
            context_.report(Severity::warning, "lighting-origin-missing",
                            fmt::format("the prop {} takes its light at '{}', but there is no info_lighting of that name; it takes it where it stands",
                                        entity.get("model"), wanted->value),
                            where);
        }
    }

    void read_origin(const DocEntity& e, WorldEntity& out) {
        const DocKey* key = e.find("origin");
        if (!key) return;
        bool complete = false;
        const std::vector<double> n = parse_numbers(key->value, &complete);
        const auto inside = [](double x) { return std::abs(x) <= kLargestCoordinate; };
        if (!complete || n.size() != 3 || !inside(n[0]) || !inside(n[1]) || !inside(n[2])) {
            context_.report(Severity::warning, "origin-invalid",
                            fmt::format("the origin is not three numbers within {} units; the entity has none",
                                        kLargestCoordinate),
                            {document_.name_of(e.file), key->line, e.id});
            return;
        }
        out.origin = {n[0], n[1], n[2]};
        out.has_origin = true;
    }

    void add_brush(const DocEntity& e, const DocBrush& b, std::size_t entity, BrushUse use, double scale,
                   WorldEntity& out) {
        std::vector<MaterialId>& ids = brush_materials_;
        std::vector<std::uint32_t>& flags = brush_flags_;
        ids.clear(), flags.clear();
        for (const DocSide& s : b.sides) {
            ids.push_back(material_of(e, b, s));
            flags.push_back(world_.materials[ids.back().at()].flags);
            const UnknownBits unknown = unknown_row_bits(s, document_.format, quake3_);
            if (unknown.contents || unknown.surface) unknown_bits_.add({document_.name_of(b.file), s.line, e.id, b.id, s.id});
            unknown_.contents |= unknown.contents, unknown_.surface |= unknown.surface;
        }
        BrushKind kind = kind_of_brush(flags, document_.format);
        if (kind.mixed) mixed_.add(where(e, b));
        if (kind.origin) {
            if (entity == 0)
                origin_in_world_.add(where(e, b));
            else if (const Box3 box = box_of(b); !box.empty()) {
                out.origin = box.center();
                out.has_origin = true;
                const std::string text = fmt::format("{} {} {}", out.origin.x, out.origin.y, out.origin.z);
                const auto key = std::ranges::find_if(out.keys, [](const DocKey& k) { return equal_ignoring_case(k.key, "origin"); });
                if (key != out.keys.end()) key->value = text;
                else out.keys.push_back({"origin", text, b.line}); // games turn the model about it
            }
            return;
        }
        apply(use, kind, e);

        WorldBrush brush;
        brush.first_side = static_cast<std::uint32_t>(world_.sides.size());
        brush.side_count = static_cast<std::uint32_t>(b.sides.size());
        brush.contents = kind.contents;
        brush.model = id<ModelId>(0); // add_entity knows better
        brush.entity = id<EntityId>(entity);
        brush.casts_light_shadow = kind.blocks_light && casts_shadow(e, use == BrushUse::model);
        brush.draws = kind.draws;
        brush.collides = (kind.blocks & kBlocksPlayers) != 0;
        brush.blocks = kind.blocks;
        brush.file = b.file;
        brush.line = b.line;
        brush.id = b.id;
        for (std::size_t i = 0; i < b.sides.size(); ++i) {
            const DocSide& s = b.sides[i];
            double asked = s.lightmap_scale > 0 ? s.lightmap_scale : scale;
            if (s.lightmap_scale > 0 && (asked < kFinestLightmapScale || asked > kCoarsestLightmapScale))
                asked = bounded(asked, {document_.name_of(b.file), s.line, e.id, b.id, s.id});
            const std::size_t index = world_.sides.size();
            WorldSide& side = world_.sides.emplace_back();
            side.points = s.points, side.material = ids[i], side.texture = s.texture, side.lightmap_scale = asked;
            side.smoothing_groups = s.smoothing_groups, side.line = s.line, side.id = s.id;
            if (s.has_content_flags && document_.format != MapFormat::vmf && !quake3_) side.smoothing_groups = phong_group_of_row(s);
            if (s.texture.in_repeats) { // brushDef: texels once the size of the texture is known
                const Material& m = world_.materials[ids[i].at()];
                side.texture.u_scale /= m.width, side.texture.u_shift *= m.width;
                side.texture.v_scale /= m.height, side.texture.v_shift *= m.height;
                side.texture.in_repeats = false;
            }
            side.editor_vertices = s.vertices;
            if (s.displacement >= 0) add_displacement(e, b, s, use, index, brush);
        }
        // Only its displaced sides are left of such a brush: it seals, splits and hides nothing.
        if (brush.displaced) brush.contents = Contents::empty;
        world_.brushes.push_back(brush);
    }

    // What cannot be built leaves its side as the flat side it was drawn on.
    void add_displacement(const DocEntity& e, const DocBrush& b, const DocSide& s, BrushUse use, std::size_t side_index, WorldBrush& brush) {
        const DocDisplacement& grid = document_.displacements[static_cast<std::size_t>(s.displacement)];
        const SourceLocation at{document_.name_of(b.file), grid.line > 0 ? grid.line : s.line, e.id, b.id, s.id};
        if (const auto flaw = flaw_of(grid)) {
            if (grid.power != 0) context_.report(Severity::error, "displacement-invalid",
                            fmt::format("a displacement cannot be built: {}; its side stays flat", *flaw), at);
            // The flat side must not seal what the displaced one would not have sealed.
            if (brush.contents == Contents::solid && use != BrushUse::model) brush.contents = Contents::detail;
            return;
        }
        if (use == BrushUse::model || use == BrushUse::hidden_model || use == BrushUse::water)
            context_.report(Severity::warning, "displacement-on-entity",
                            fmt::format("a brush of {} has a displacement: it moves with its entity here, the original tools refuse it",
                                        e.get("classname")),
                            at);
        brush.displaced = true;
        world_.sides[side_index].displacement = static_cast<std::int32_t>(world_.displacements.size());
        world_.displacements.push_back({id<SideId>(side_index), grid});
    }

    void add_patch(const DocEntity& e, const DocPatch& p, std::size_t entity, BrushUse use, double scale, WorldEntity& out) {
        const SourceLocation at{document_.name_of(e.file), p.line, e.id, p.id};
        if (const auto flaw = flaw_of(p)) {
            context_.report(Severity::error, "patch-invalid", fmt::format("a patch cannot be built: {}; it is left out", *flaw), at);
            return;
        }
        if (use == BrushUse::hidden_model || use == BrushUse::area_portal || use == BrushUse::occluder || use == BrushUse::vis_cluster) {
            hidden_patches_.add(at);
            return;
        }
        DocSide row; // materials are known by name and by the numbers behind it
        row.material = p.material, row.contents = p.contents, row.surface_flags = p.surface_flags, row.value = p.value;
        row.has_content_flags = p.contents != 0 || p.surface_flags != 0 || p.value != 0;
        WorldPatch patch;
        patch.entity = id<EntityId>(entity);
        patch.model = id<ModelId>(0);
        if (use == BrushUse::model || use == BrushUse::water) {
            if (!out.model.valid()) out.model = id<ModelId>(world_.model_count++);
            patch.model = out.model;
        }
        patch.material = intern(row, at);
        patch.lightmap_scale = scale;
        patch.file = p.file;
        patch.grid = p;
        world_.patches.push_back(std::move(patch));
    }

    void apply(BrushUse use, BrushKind& kind, const DocEntity& e) const {
        const bool wall = opaque(kind.contents);
        const auto become = [&](Contents c) {
            kind.contents = c;
            kind.blocks = blocks_of(c, document_.format);
        };
        const auto mark = [&](Contents c) { // neither drawn nor met
            kind.contents = c;
            kind.draws = kind.blocks_light = false;
            kind.blocks = 0;
        };
        switch (use) {
        case BrushUse::structural:
            break;
        case BrushUse::ladder:
        case BrushUse::detail:
            if (wall) become(Contents::detail);
            break;
        case BrushUse::fence:
        case BrushUse::illusion:
            // Full blocks stop what walls stop, sight included: what is drawn on them is not known to have holes.
            if (wall) kind.contents = Contents::window;
            if (use == BrushUse::illusion) kind.blocks = 0;
            break;
        case BrushUse::area_portal:
            mark(Contents::area_portal);
            break;
        case BrushUse::occluder:
            mark(Contents::occluder);
            break;
        case BrushUse::vis_cluster:
            mark(Contents::vis_cluster);
            break;
        case BrushUse::water:
            if (wall || kind.contents == Contents::window || kind.contents == Contents::grate) become(liquid_of(e));
            kind.blocks_light = false;
            break;
        case BrushUse::model:
            // Nothing seals or hides in a model but in itself; detail is a word of the world.
            if (kind.contents == Contents::detail) kind.contents = Contents::solid;
            if (wall && faded_by_portal(e)) become(Contents::window);
            if (passable_model(e)) kind.blocks = 0;
            break;
        case BrushUse::hidden_model:
            mark(Contents::trigger);
            break;
        }
    }

    // The brush that a func_areaportalwindow fades over its portal is seen through while it fades.
    bool faded_by_portal(const DocEntity& e) const {
        const std::string_view name = e.get("targetname");
        return !name.empty() && portal_windows_.contains(lower_case(name));
    }

    void report_counts() {
        const auto tell = [&](const Counted& c, Severity severity, std::string_view code,
                              std::string_view message) {
            if (c.count > 0)
                context_.report(severity, std::string(code), fmt::format(fmt::runtime(message), c.count), c.first);
        };
        for (const NotHandled& kind : not_handled_classes())
            if (const auto it = classes_.find(kind.classname); it != classes_.end())
                tell(it->second, kind.severity, kind.code, kind.message);
        tell(skipped_, Severity::warning, "not-handled-primitive", "{} primitives could not be read and are left out");
        tell(hidden_patches_, Severity::note, "patch-without-use",
             "{} patches belong to triggers or other volumes that are not drawn: they bound nothing and are left out");
        tell(mixed_, Severity::warning, "mixed-contents",
             "{} brushes have liquid sides beside solid ones; they are solid");
        if (omitted_.count > 0)
            context_.report(Severity::note, "layer-omitted",
                            fmt::format("{} entities with {} brushes are in layers that the editor omits from export; they are left out",
                                        omitted_.count, omitted_brushes_),
                            omitted_.first);
        if (outside_region_.count + brushes_outside_region_ > 0)
            context_.report(Severity::note, "outside-region",
                            fmt::format("only what the region brushes allow is compiled: {} entities and {} brushes are left out",
                                        outside_region_.count, brushes_outside_region_),
                            {document_.file});
        if (unknown_bits_.count > 0)
            context_.report(Severity::note, "row-bits-unknown",
                            fmt::format("{} sides have bits that Quake 2 does not define (contents 0x{:x}, surface 0x{:x}); they are ignored",
                                        unknown_bits_.count, unknown_.contents, unknown_.surface),
                            unknown_bits_.first);
        tell(origin_in_world_, Severity::warning, "origin-brush-in-world",
             "{} origin brushes of the world mean nothing; they are left out");
    }
};

} // namespace

Result<World> build_world(const Document& document, MaterialDatabase& materials, const WorldOptions& options,
                          Context& context) {
    return Builder(document, materials, options, context).run();
}

} // namespace kiln
