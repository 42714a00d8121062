#include "compiler/world/contents.h"
#include "compiler/world/entity_classes.h"
#include "compiler/world/omitted_layers.h"
#include "compiler/world/overlays.h"
#include "compiler/world/row_flags.h"
#include "compiler/world/world.h"
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <optional>
#include <tuple>

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

// Middle of the box of an origin brush. Rounded arithmetic: it is a convenience of the editor, not geometry.
std::optional<Vec3> centre_of(const DocBrush& brush) {
    struct Plane {
        Vec3 n;
        double d;
    };
    std::vector<Plane> planes;
    for (const DocSide& s : brush.sides) {
        std::array<Vec3, 3> p;
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t k = 0; k < 3; ++k) p[i][k] = s.points[i][k].to_double();
        const Vec3 n = normalize(cross(p[2] - p[0], p[1] - p[0])); // outward: points run clockwise
        planes.push_back({n, dot(n, p[0])});
    }
    constexpr std::size_t kMostSides = 64; // corners are found by trying all triples
    constexpr double kOutside = 0.01;      // map units
    if (planes.size() > kMostSides) return std::nullopt;
    Box3 box;
    for (std::size_t i = 0; i < planes.size(); ++i)
        for (std::size_t j = i + 1; j < planes.size(); ++j)
            for (std::size_t k = j + 1; k < planes.size(); ++k) {
                const Vec3 jk = cross(planes[j].n, planes[k].n);
                const double det = dot(planes[i].n, jk);
                if (std::abs(det) < 1e-9) continue;
                const Vec3 x = (jk * planes[i].d + cross(planes[k].n, planes[i].n) * planes[j].d +
                                cross(planes[i].n, planes[j].n) * planes[k].d) /
                               det;
                bool inside = true;
                for (const Plane& q : planes) inside = inside && dot(q.n, x) <= q.d + kOutside;
                if (inside) box.add(x);
            }
    if (box.empty()) return std::nullopt;
    return box.center();
}

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
        for (std::size_t e = 0; e < document_.entities.size(); ++e) {
            context_.check_cancelled();
            const DocEntity& entity = document_.entities[e];
            if (omitted[e]) omitted_.add({document_.name_of(entity.file), entity.line, entity.id});
            if (omitted[e]) omitted_brushes_ += entity.brushes.size();
            if (!omitted[e] || e == 0) add_entity(entity, omitted[e] == 0);
        }
        read_overlays(world_, database_, context_);
        report_counts();
        bool any = false;
        for (const WorldBrush& b : world_.brushes)
            any = any || (b.model.value == 0 && (b.contents == Contents::solid || b.contents == Contents::detail));
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
    Counted displacements_, patches_, mixed_, origin_in_world_, omitted_;
    std::size_t omitted_brushes_ = 0;

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

    MaterialId intern(const DocSide& side, const SourceLocation& where) {
        Material m = with_row_flags(database_.find(side.material, context_, where), side, document_.format, quake3_);
        const MaterialKey key{m.name, m.flags, m.emission.x, m.alpha};
        const auto [it, added] = material_ids_.try_emplace(key, id<MaterialId>(world_.materials.size()));
        if (added) world_.materials.push_back(std::move(m));
        return it->second;
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
        const auto patches = e.skipped_primitives + static_cast<std::uint32_t>(e.patches.size());
        patches_.count += patches;
        if (patches > 0 && patches_.first.file.empty()) patches_.first = {document_.name_of(e.file), e.line, e.id};

        const BrushUse use = brush_use(e, index == 0, document_.format);
        const bool own_model = use == BrushUse::model || use == BrushUse::hidden_model;
        if (index == 0) out.model = id<ModelId>(0);
        const double scale = index == 0 ? world_scale_ : scale_of(e, world_scale_);
        if (use != BrushUse::dropped && with_brushes) {
            for (const DocBrush& b : e.brushes) {
                const std::size_t before = world_.brushes.size();
                add_brush(e, b, index, use, scale, out);
                if (own_model && world_.brushes.size() > before) {
                    if (!out.model.valid()) out.model = id<ModelId>(world_.model_count++);
                    world_.brushes.back().model = out.model;
                }
            }
        }
        world_.entities.push_back(std::move(out));
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
        std::vector<MaterialId> ids;
        std::vector<std::uint32_t> flags;
        bool displaced = false;
        for (const DocSide& s : b.sides) {
            ids.push_back(intern(s, {document_.name_of(b.file), s.line, e.id, b.id, s.id}));
            flags.push_back(world_.materials[ids.back().at()].flags);
            displaced = displaced || s.displacement >= 0;
            if (s.displacement >= 0) displacements_.add({document_.name_of(b.file), s.line, e.id, b.id, s.id});
        }
        BrushKind kind = kind_of_brush(flags);
        if (kind.mixed) mixed_.add(where(e, b));
        if (kind.origin) {
            if (entity == 0)
                origin_in_world_.add(where(e, b));
            else if (const std::optional<Vec3> centre = centre_of(b)) {
                out.origin = *centre;
                out.has_origin = true;
            }
            return;
        }
        apply(use, displaced, kind, e);

        WorldBrush brush;
        brush.first_side = static_cast<std::uint32_t>(world_.sides.size());
        brush.side_count = static_cast<std::uint32_t>(b.sides.size());
        brush.contents = kind.contents;
        brush.model = id<ModelId>(0); // add_entity knows better
        brush.entity = id<EntityId>(entity);
        brush.casts_light_shadow = kind.blocks_light && casts_shadow(e, use);
        brush.draws = kind.draws;
        brush.collides = kind.collides;
        brush.blocks = kind.collides ? kBlocksAll : 0;
        brush.file = b.file;
        brush.line = b.line;
        brush.id = b.id;
        for (std::size_t i = 0; i < b.sides.size(); ++i) {
            const DocSide& s = b.sides[i];
            const double asked = s.lightmap_scale > 0
                                     ? bounded(s.lightmap_scale, {document_.name_of(b.file), s.line, e.id, b.id, s.id})
                                     : scale;
            WorldSide side;
            side.points = s.points, side.material = ids[i], side.texture = s.texture, side.lightmap_scale = asked;
            side.smoothing_groups = s.smoothing_groups, side.line = s.line, side.id = s.id;
            side.editor_vertices = s.vertices;
            if (s.displacement >= 0) {
                side.displacement = static_cast<std::int32_t>(world_.displacements.size());
                world_.displacements.push_back({id<SideId>(world_.sides.size()), document_.displacements[static_cast<std::size_t>(s.displacement)]});
            }
            world_.sides.push_back(std::move(side));
        }
        world_.brushes.push_back(brush);
    }

    static void apply(BrushUse use, bool displaced, BrushKind& kind, const DocEntity& e) {
        const bool wall = kind.contents == Contents::solid || kind.contents == Contents::detail;
        switch (use) {
        case BrushUse::structural:
            break;
        case BrushUse::detail:
            if (wall) kind.contents = Contents::detail;
            break;
        case BrushUse::fence:
        case BrushUse::illusion:
            if (wall) kind.contents = Contents::window;
            if (use == BrushUse::illusion) kind.collides = false;
            break;
        case BrushUse::area_portal:
            kind = {Contents::area_portal, false, false, false, false, false};
            break;
        case BrushUse::model:
            // Nothing seals or hides in a model but in itself; detail is a word of the world.
            if (kind.contents == Contents::detail) kind.contents = Contents::solid;
            if (passable_model(e)) kind.collides = false;
            break;
        case BrushUse::hidden_model:
            kind = {Contents::trigger, false, false, false, false, false};
            break;
        case BrushUse::dropped:
            break;
        }
        // A displacement never seals. Until its surface is built, its brush stands in for it as it is.
        if (displaced && kind.contents == Contents::solid) kind.contents = Contents::detail;
    }

    static bool casts_shadow(const DocEntity& e, BrushUse use) {
        const double asked = e.number("_shadow", 0);
        if (use == BrushUse::model) return asked == 1 || e.number("vrad_brush_cast_shadows", 0) == 1;
        return asked != -1;
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
        tell(displacements_, Severity::warning, "not-handled-displacement",
             "{} displacements are not built yet: their brushes stand flat, as detail that seals nothing");
        tell(patches_, Severity::warning, "not-handled-patch",
             "{} patches or primitive brushes are not read yet and left out");
        tell(mixed_, Severity::warning, "mixed-contents",
             "{} brushes have liquid sides beside solid ones; they are solid");
        if (omitted_.count > 0)
            context_.report(Severity::note, "layer-omitted",
                            fmt::format("{} entities with {} brushes are in layers that the editor omits from export; they are left out",
                                        omitted_.count, omitted_brushes_),
                            omitted_.first);
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
