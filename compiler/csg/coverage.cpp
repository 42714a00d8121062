// Each side polygon minus the brushes that own the space in front of it. For a face of brush A and a brush B of the
// same model, "in front" is where points just off the face lie inside B: inside B's volume, or on B's face of the
// same plane facing the other way. B there takes the part away if it is as strong as A or stronger; if it is weaker
// the part stays and says what is in front of it. Where B's face lies on the same plane facing the same way, the
// stronger brush has the face, of equals the one earlier in the file.
#include "compiler/csg/coverage.h"
#include "compiler/csg/polytope.h"
#include "libs/parallel/parallel.h"
#include <algorithm>

namespace kiln {

std::optional<int> strength(Contents contents) {
    switch (contents) {
    case Contents::solid: return 0;
    case Contents::detail: return 1;
    case Contents::window: return 2;
    case Contents::grate: return 3;
    case Contents::lava: return 4;
    case Contents::slime: return 5;
    case Contents::water: return 6;
    default: return std::nullopt;
    }
}

namespace csg_detail {
namespace {

// A part of a face still to be cut by `others`, strongest first; those that cannot touch it are left out.
struct Piece {
    PlanePolygon polygon;
    Box3 box;
    std::vector<std::uint32_t> others;
};

// Of so many brushes ahead it pays to cut first by one from the middle of the piece: the lists halve from piece to
// piece, where in file order a floor under 20,000 brushes would meet each of them with each of its pieces.
constexpr std::size_t kMany = 24;
constexpr std::size_t kChoices = 8; // then in order: choosing looks at the whole list

enum class Meeting : std::uint8_t { apart, in_front, same_face };

// How brush B meets the polygon; its planes that cut the polygon go to `cuts`. `apart` is certain only for those
// that the simple test finds: pieces may still miss B.
Meeting meet(const PlaneTable& planes, const PlanePolygon& polygon, const BrushPolytope& b, std::vector<PlaneId>& cuts) {
    cuts.clear();
    Meeting meeting = Meeting::in_front;
    for (const PlanePolygon& face : b.faces) {
        const PlaneId q = face.support;
        if ((q.value ^ polygon.support.value) <= 1) {
            if (q == polygon.support) meeting = Meeting::same_face;
            continue;
        }
        const PolygonSides sides = classify(planes, polygon, q);
        if (!sides.back) return Meeting::apart;
        if (sides.front) cuts.push_back(q);
    }
    return meeting;
}

// Takes the part of `piece` behind all `cuts` out of it: the rest is appended to `rest`, the part returned. Nothing:
// there is no such part and `rest` is untouched.
std::optional<PlanePolygon> take_part(const PlaneTable& planes, const PlanePolygon& piece,
                                      const std::vector<PlaneId>& cuts, std::vector<PlanePolygon>& rest) {
    PlanePolygon inside = piece;
    if (cuts.size() > 1) { // prove that there is a part before cutting anything to get at it
        for (const PlaneId q : cuts)
            if (!clip_to_back(planes, inside, q)) return std::nullopt;
        inside = piece;
    }
    for (const PlaneId q : cuts) {
        SplitPolygon parts = split(planes, inside, q);
        if (parts.front) rest.push_back(std::move(*parts.front));
        inside = std::move(*parts.back);
    }
    return inside;
}

class Cutter {
public:
    Cutter(const World& world, const PlaneTable& planes, const std::vector<BrushPolytope>& brushes)
        : world_(world), planes_(planes), brushes_(brushes) {}

    void cut(std::size_t brush, std::vector<std::uint32_t> near, std::vector<Fragment>& out) const {
        const WorldBrush& a = world_.brushes[brush];
        if (!brushes_[brush].valid) return;
        if (a.contents == Contents::hint || a.contents == Contents::area_portal) {
            for (std::size_t f = 0; f < brushes_[brush].faces.size(); ++f) {
                const SideId side = brushes_[brush].sides[f];
                const MaterialId m = world_.sides[side.at()].material;
                if (a.contents == Contents::hint && !(m.valid() && (world_.materials[m.at()].flags & kHint))) continue;
                out.push_back(fragment(brush, f, brushes_[brush].faces[f]));
            }
            return;
        }
        const bool occluder = a.contents == Contents::occluder;
        if (!occluder && !strength(a.contents)) return;
        std::erase_if(near, [&](std::uint32_t b) {
            const WorldBrush& other = world_.brushes[b];
            // Occluders meet only those of their own entity, all of one strength.
            const bool meets = occluder ? other.contents == Contents::occluder && other.entity == a.entity
                                        : other.model == a.model && strength(other.contents).has_value();
            return b == brush || !meets || !overlap(brushes_[b].bounds, brushes_[brush].bounds);
        });
        // Strongest first: of the weaker ones, the first to be found in front is the one that fills the space.
        std::stable_sort(near.begin(), near.end(), [&](std::uint32_t x, std::uint32_t y) {
            return strength_of(x) < strength_of(y);
        });
        for (std::size_t f = 0; f < brushes_[brush].faces.size(); ++f)
            if (!occluder || occludes(brushes_[brush].sides[f])) cut_face(brush, f, near, out);
    }

private:
    const World& world_;
    const PlaneTable& planes_;
    const std::vector<BrushPolytope>& brushes_;

    int strength_of(std::size_t brush) const { return strength(world_.brushes[brush].contents).value_or(0); } // occluders: 0
    // Designers paint nodraw what of an occluder need not occlude.
    bool occludes(SideId side) const {
        const MaterialId m = world_.sides[side.at()].material;
        return !m.valid() || !(world_.materials[m.at()].flags & (kNoDraw | kSkip));
    }

    Fragment fragment(std::size_t brush, std::size_t face, PlanePolygon polygon) const {
        Fragment f;
        f.polygon = std::move(polygon);
        f.side = brushes_[brush].sides[face];
        f.brush = id<BrushId>(brush);
        f.model = world_.brushes[brush].model;
        f.behind = world_.brushes[brush].contents;
        return f;
    }

    void cut_face(std::size_t brush, std::size_t face, const std::vector<std::uint32_t>& near,
                  std::vector<Fragment>& out) const {
        const PlanePolygon& whole = brushes_[brush].faces[face];
        const Contents contents = world_.brushes[brush].contents;
        const int own = strength_of(brush);
        const auto finish = [&](PlanePolygon polygon, Contents front) {
            Fragment f = fragment(brush, face, std::move(polygon));
            f.front = front;
            f.covered = contents == Contents::solid && front == Contents::detail;
            const auto liquid = [](Contents c) { return c == Contents::water || c == Contents::slime || c == Contents::lava; };
            f.both_sides = liquid(contents) && (front == Contents::empty || liquid(front));
            out.push_back(std::move(f));
        };
        std::vector<Piece> stack;
        const auto push = [&](PlanePolygon polygon, const std::uint32_t* first, const std::uint32_t* last) {
            Piece piece{std::move(polygon), {}, {}};
            piece.box = box_of(planes_, piece.polygon);
            for (; first != last; ++first)
                if (overlap(brushes_[*first].bounds, piece.box)) piece.others.push_back(*first);
            stack.push_back(std::move(piece));
        };
        push(whole, near.data(), near.data() + near.size());
        std::vector<PlaneId> cuts;
        std::vector<PlanePolygon> rest;
        while (!stack.empty()) {
            Piece piece = std::move(stack.back());
            stack.pop_back();
            bool cut = false;
            for (std::size_t i = 0; i < piece.others.size() && !cut; ++i) {
                if (i < kChoices) choose_next(piece, i, own);
                const std::uint32_t b = piece.others[i];
                const Meeting meeting = meet(planes_, piece.polygon, brushes_[b], cuts);
                if (meeting == Meeting::apart) continue;
                const int theirs = strength_of(b);
                const bool removes = meeting == Meeting::same_face ? theirs < own || (theirs == own && b < brush)
                                                                   : theirs <= own;
                if (meeting == Meeting::same_face && !removes) continue;
                rest.clear();
                std::optional<PlanePolygon> inside = take_part(planes_, piece.polygon, cuts, rest);
                if (!inside) continue;
                cut = true;
                if (!removes) finish(std::move(*inside), world_.brushes[b].contents);
                const std::uint32_t* others = piece.others.data();
                for (PlanePolygon& r : rest) push(std::move(r), others + i + 1, others + piece.others.size());
            }
            if (!cut) finish(std::move(piece.polygon), Contents::empty);
        }
    }

    // Where many brushes that take away lie ahead (their order does not matter), the one nearest to the piece's middle
    // comes next.
    void choose_next(Piece& piece, std::size_t i, int own) const {
        const auto removes = [&](std::uint32_t b) { return strength_of(b) <= own; };
        if (piece.others.size() - i < kMany || !removes(piece.others[i + kMany - 1])) return;
        const Vec3 middle = piece.box.center();
        std::size_t best = i;
        double nearest = 1e300;
        for (std::size_t j = i; j < piece.others.size() && removes(piece.others[j]); ++j) {
            const Vec3 off = brushes_[piece.others[j]].bounds.center() - middle;
            if (const double d = dot(off, off); d < nearest) nearest = d, best = j;
        }
        std::swap(piece.others[i], piece.others[best]);
    }
};

} // namespace

std::vector<Fragment> cut_fragments(const World& world, const PlaneTable& planes,
                                    const std::vector<BrushPolytope>& brushes,
                                    const std::vector<std::vector<std::uint32_t>>& near, Context& context) {
    const Cutter cutter(world, planes, brushes);
    std::vector<std::vector<Fragment>> slots(brushes.size());
    parallel_for(context, "csg", brushes.size(), [&](std::size_t b) { cutter.cut(b, near[b], slots[b]); });
    std::vector<Fragment> fragments;
    std::size_t count = 0;
    for (const auto& slot : slots) count += slot.size();
    fragments.reserve(count);
    for (auto& slot : slots)
        for (Fragment& f : slot) fragments.push_back(std::move(f));
    std::stable_sort(fragments.begin(), fragments.end(), [](const Fragment& x, const Fragment& y) {
        if (x.model != y.model) return x.model < y.model;
        return x.side < y.side;
    });
    return fragments;
}

} // namespace csg_detail
} // namespace kiln
