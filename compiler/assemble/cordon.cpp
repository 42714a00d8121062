#include "compiler/assemble/cordon.h"
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace kiln::assemble_detail {
namespace {

constexpr double kWall = 16; // map units, thickness of the walls around a cordon
// What Hammer's game configurations name; a cut map is then lit as by its own sky.
constexpr const char* kWallMaterial = "tools/toolsskybox";

struct Plane {
    Vec3 normal; // outward, unit
    double distance;
};

std::optional<Plane> plane_of(const DocSide& side) {
    std::array<Vec3, 3> p;
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) p[i][k] = side.points[i][k].to_double();
    const Vec3 n = cross(p[2] - p[0], p[1] - p[0]);
    if (length(n) == 0) return std::nullopt;
    return Plane{normalize(n), dot(normalize(n), p[0])};
}

// Whether a brush and a box have a point in common, but for rounding: the box, cut by the brush's planes, keeps a corner.
// Planes are cut one after another from the box's own surface, and a brush within the box is found by the box of the
// faces that are left; so what is cut is a convex solid, face by face.
bool touches(const std::vector<Plane>& planes, const Box3& box) {
    using Polygon = std::vector<Vec3>;
    constexpr double kOn = 1e-6; // map units: touching counts
    std::vector<Polygon> faces;
    for (std::size_t k = 0; k < 3; ++k)
        for (const double at : {box.lo[k], box.hi[k]}) {
            Polygon face(4);
            for (std::size_t c = 0; c < 4; ++c) {
                face[c][k] = at;
                face[c][(k + 1) % 3] = c == 1 || c == 2 ? box.hi[(k + 1) % 3] : box.lo[(k + 1) % 3];
                face[c][(k + 2) % 3] = c >= 2 ? box.hi[(k + 2) % 3] : box.lo[(k + 2) % 3];
            }
            faces.push_back(std::move(face));
        }
    for (const Plane& plane : planes) {
        std::vector<Polygon> kept;
        std::vector<Vec3> on; // the corners of the new face
        for (const Polygon& face : faces) {
            Polygon cut;
            for (std::size_t i = 0; i < face.size(); ++i) {
                const Vec3 a = face[i], b = face[(i + 1) % face.size()];
                const double da = dot(plane.normal, a) - plane.distance, db = dot(plane.normal, b) - plane.distance;
                if (da <= kOn) cut.push_back(a);
                if ((da > kOn && db < -kOn) || (da < -kOn && db > kOn)) cut.push_back(a + (b - a) * (da / (da - db)));
            }
            for (const Vec3& p : cut)
                if (std::fabs(dot(plane.normal, p) - plane.distance) <= 2 * kOn) on.push_back(p);
            if (!cut.empty()) kept.push_back(std::move(cut));
        }
        if (kept.empty()) return false;
        if (on.size() >= 3) {
            // Counter-clockwise around their middle; the order is all that the next cut needs.
            Vec3 middle{};
            for (const Vec3& p : on) middle += p;
            middle = middle / static_cast<double>(on.size());
            const Frame f = frame_around(plane.normal);
            const auto angle = [&](const Vec3& p) { return std::atan2(dot(p - middle, f.b), dot(p - middle, f.t)); };
            std::ranges::stable_sort(on, {}, angle);
            kept.push_back(std::move(on));
        }
        faces = std::move(kept);
    }
    return true;
}

std::vector<Plane> planes_of(const DocBrush& brush) {
    std::vector<Plane> planes;
    for (const DocSide& s : brush.sides)
        if (const std::optional<Plane> p = plane_of(s)) planes.push_back(*p);
    return planes;
}

bool inside(const Box3& box, Vec3 p) {
    for (std::size_t k = 0; k < 3; ++k)
        if (p[k] < box.lo[k] || p[k] > box.hi[k]) return false;
    return true;
}

// `box` without the inside of `hole`: up to six boxes.
void subtract(const Box3& box, const Box3& hole, std::vector<Box3>& out) {
    for (std::size_t k = 0; k < 3; ++k)
        if (box.hi[k] <= hole.lo[k] || box.lo[k] >= hole.hi[k]) {
            out.push_back(box);
            return;
        }
    Box3 rest = box;
    for (std::size_t k = 0; k < 3; ++k) {
        if (rest.lo[k] < hole.lo[k]) {
            Box3 part = rest;
            part.hi[k] = rest.lo[k] = hole.lo[k];
            out.push_back(part);
        }
        if (rest.hi[k] > hole.hi[k]) {
            Box3 part = rest;
            part.lo[k] = rest.hi[k] = hole.hi[k];
            out.push_back(part);
        }
    }
}

std::array<Decimal, 3> decimals(Vec3 p) {
    std::array<Decimal, 3> d;
    for (std::size_t k = 0; k < 3; ++k) d[k] = parse_decimal(fmt::format("{}", p[k])).value_or(Decimal{});
    return d;
}

DocBrush brush_of(const Box3& b, int line, int& next_side) {
    DocBrush brush;
    brush.line = line;
    for (std::size_t k = 0; k < 3; ++k)
        for (const bool high : {false, true}) {
            const std::size_t i = (k + 1) % 3, j = (k + 2) % 3;
            Vec3 p = high ? b.hi : b.lo, q = p, r = p;
            // Clockwise seen from outside: (r - p) x (q - p) points out.
            (high ? r : q)[i] = high ? b.lo[i] : b.hi[i];
            (high ? q : r)[j] = high ? b.lo[j] : b.hi[j];
            DocSide side;
            side.line = line;
            side.id = next_side++;
            side.points = {decimals(p), decimals(q), decimals(r)};
            side.material = kWallMaterial;
            side.texture.u_axis = {}, side.texture.v_axis = {};
            side.texture.u_axis[i] = 1, side.texture.v_axis[j] = -1;
            side.texture.u_scale = side.texture.v_scale = 0.25;
            brush.sides.push_back(std::move(side));
        }
    return brush;
}

struct Room {
    Box3 box;
    int line;
};

std::vector<DocBrush> walls_of(const std::vector<Room>& rooms, int next_side) {
    std::vector<DocBrush> walls;
    for (const Room& c : rooms)
        for (std::size_t k = 0; k < 3; ++k)
            for (const bool high : {false, true}) {
                Box3 slab = c.box; // x walls cover the edges of y walls, and so on: they abut and do not overlap
                (high ? slab.lo : slab.hi)[k] = high ? c.box.hi[k] : c.box.lo[k];
                (high ? slab.hi : slab.lo)[k] += high ? kWall : -kWall;
                for (std::size_t j = k + 1; j < 3; ++j) slab.lo[j] -= kWall, slab.hi[j] += kWall;
                std::vector<Box3> parts{slab};
                for (const Room& other : rooms) { // boxes that meet are one room
                    std::vector<Box3> left;
                    for (const Box3& part : parts) subtract(part, other.box, left);
                    parts = std::move(left);
                }
                for (const Box3& part : parts) walls.push_back(brush_of(part, c.line, next_side));
            }
    return walls;
}

// Displacements whose sides are gone go too, and the others close up.
void drop_displacements(Document& document) {
    std::vector<std::int32_t> moved(document.displacements.size(), -1);
    std::vector<DocDisplacement> kept;
    for (DocEntity& e : document.entities)
        for (DocBrush& b : e.brushes)
            for (DocSide& s : b.sides) {
                if (s.displacement < 0 || static_cast<std::size_t>(s.displacement) >= moved.size()) continue;
                std::int32_t& to = moved[static_cast<std::size_t>(s.displacement)];
                if (to < 0) to = static_cast<std::int32_t>(kept.size()), kept.push_back(std::move(document.displacements[static_cast<std::size_t>(s.displacement)]));
                s.displacement = to;
            }
    document.displacements = std::move(kept);
}

} // namespace

void cut_to_cordons(Document& document, Context& context) {
    std::vector<Room> active;
    for (const DocCordon& c : document.cordons) {
        if (!c.active || !(c.box.lo.x < c.box.hi.x && c.box.lo.y < c.box.hi.y && c.box.lo.z < c.box.hi.z)) continue;
        Box3 box = c.box;
        constexpr double kFar = kLargestCoordinate - kWall; // its walls are brushes like others
        for (std::size_t k = 0; k < 3; ++k) box.lo[k] = std::clamp(box.lo[k], -kFar, kFar - 1), box.hi[k] = std::clamp(box.hi[k], 1 - kFar, kFar);
        if (!(box.lo == c.box.lo && box.hi == c.box.hi))
            context.report(Severity::warning, "cordon-large", fmt::format("the cordon reaches beyond what a map can hold; its walls stand at {} map units", kFar), {document.file, c.line});
        active.push_back({box, c.line});
    }
    if (active.empty() || document.entities.empty()) {
        context.report(Severity::warning, "cordon-none", "the map has no active cordon: all of it is built", {.file = document.file});
        return;
    }
    std::size_t brushes = 0, entities = 0;
    int next_side = 1;
    const auto outside = [&](Vec3 p) { return std::ranges::none_of(active, [&](const Room& c) { return inside(c.box, p); }); };
    std::vector<DocEntity> kept;
    for (std::size_t i = 0; i < document.entities.size(); ++i) {
        context.check_cancelled();
        DocEntity& e = document.entities[i];
        const std::size_t had = e.brushes.size() + e.patches.size();
        for (const DocBrush& b : e.brushes)
            for (const DocSide& s : b.sides) next_side = std::max(next_side, std::min(s.id, INT32_MAX - 1000000) + 1);
        brushes += std::erase_if(e.brushes, [&](const DocBrush& b) {
            const std::vector<Plane> planes = planes_of(b);
            return std::ranges::none_of(active, [&](const Room& c) { return touches(planes, c.box); });
        });
        brushes += std::erase_if(e.patches, [&](const DocPatch& p) {
            Box3 hull; // a Bezier surface lies in the hull of its points
            for (const Vec3& v : p.points) hull.add(v);
            return std::ranges::none_of(active, [&](const Room& c) { return overlap(c.box, hull); });
        });
        // A brush entity goes with its brushes, a point entity with its origin; without either it is nowhere, and stays.
        bool gone = i > 0 && had > 0 && e.brushes.empty() && e.patches.empty();
        if (i > 0 && had == 0) {
            constexpr double kNowhere = 1e300;
            const Vec3 origin = e.vector("origin", {kNowhere, 0, 0});
            gone = origin.x != kNowhere && outside(origin);
        }
        if (gone) ++entities;
        else kept.push_back(std::move(e));
    }
    document.entities = std::move(kept);
    drop_displacements(document);
    std::vector<DocBrush> walls = walls_of(active, next_side);
    const std::size_t wall_count = walls.size();
    for (DocBrush& wall : walls) document.entities[0].brushes.push_back(std::move(wall));
    context.report(Severity::note, "cordon",
                   fmt::format("{} active cordons: {} brushes and {} entities outside are left out, {} walls of {} close them", active.size(), brushes,
                               entities, wall_count, kWallMaterial),
                   {document.file, active[0].line});
}

} // namespace kiln::assemble_detail
