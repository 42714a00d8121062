// The adaptive lattice. Cells are split while their air sees different corners in different places (down to the
// finest size), then greedily by error times volume until the estimated error of the interpolated cube is met.
// All parallel work writes its own slot; everything that numbers or decides runs in index order.
#include "compiler/ambient/cell_weights.h"
#include "compiler/ambient/separate.h"
#include "compiler/ambient/sites.h"
#include "libs/core/hash.h"
#include "libs/parallel/parallel.h"
#include <bit>

namespace kiln::ambient {

namespace {

constexpr std::size_t kErrorPoints = 12;     // per cell that may still be refined
constexpr std::size_t kErrorPointsFinest = 2; // per finest cell: only for the estimate, for which
constexpr std::size_t kErrorCellsFinest = 512; // as many of those that come in one round will do, or
constexpr std::size_t kErrorShareFinest = 4;   // one in so many where these are more
constexpr std::uint32_t kErrorRays = 256;    // per point; two halves make the estimate free of their noise
constexpr std::size_t kMaxSamples = 160;     // of a cell's air
constexpr std::size_t kMostPlaces = 384;     // beside faces, asked about in one cell
constexpr std::size_t kAsked = 8;            // samples that are asked whether they see such a place
constexpr double kFloor = 0.02;              // of the mean cube: what darkness counts at least in relative errors
constexpr std::uint32_t kMostRays = 8;       // times options.rays
constexpr std::size_t kMostSides = 32;       // of a finest cell that walls cross
constexpr int kMostRounds = 8;                // of asking border points whether they belong where the planes put them

struct Sample {
    Vec3 point;
    double volume = 0; // map units cubed that it stands for; 0: only there for what it sees
    template <class A> void fields(A& a) { a(point, volume); }
};

struct Variant { // becomes one AmbientCell
    std::array<std::uint32_t, 8> sites{};
    std::uint8_t mask = 0;
    bool has_plane = false;
    Vec3 normal{};
    double distance = 0;
    std::uint32_t beyond = 0, behind = 0; // as in Side
    std::uint32_t own = UINT32_MAX;       // place in Work::own of its cube; none: it has those of the corners in the mask
    template <class A> void fields(A& a) { a(mask, has_plane, normal, distance, beyond, behind, own); }
};

enum class State : std::uint8_t { no_air, cell, split };

struct Work {
    Grid at{};
    std::int32_t size = 0; // finest cells
    State state = State::no_air;
    std::int32_t first_child = -1;
    std::array<std::uint32_t, 8> corners{}; // sites
    std::vector<Sample> samples;
    std::vector<Vec3> border;               // more of its air, on its faces, edges and corners, seen from the samples
    std::vector<Variant> variants;
    std::vector<Vec3> own;                  // places of cubes of its own air
    double volume = 0;                      // of its air
    double stands_for = 0;                  // volume of air whose error it tells
    bool known = false;                     // from an earlier lattice
    bool measured = false;
    double error2 = 0, noise2 = 0;          // relative, squared, mean over its air
    double spread = 0;                      // variance of error2 as estimated
    std::uint64_t rays = 0;
};

double unit(std::uint64_t hash) { return double(hash >> 11) * 0x1p-53; }

class Builder {
public:
    Builder(const Air& air, const AmbientOptions& options, Context& context)
        : air_(air), options_(options), context_(context) {}
    Ambient run();

private:
    const Air& air_;
    const AmbientOptions& options_;
    Context& context_;
    double finest_ = 64;
    std::int32_t root_ = 4; // root cell in finest cells
    Vec3 origin_;
    std::array<std::uint32_t, 3> count_{};
    std::vector<Work> work_;
    std::vector<Site> sites_;
    std::unordered_map<Grid, std::uint32_t, GridHash> corner_;
    double floor2_ = -1; // squared norm of the error floor; < 0: not known yet

    Vec3 place(Grid g) const { return origin_ + Vec3{double(g[0]), double(g[1]), double(g[2])} * finest_; }
    Box3 box_of(const Work& work) const {
        Box3 box;
        box.add(place(work.at));
        box.add(place({work.at[0] + work.size, work.at[1] + work.size, work.at[2] + work.size}));
        return box;
    }
    std::uint64_t seed(Grid g, std::uint64_t what) const {
        return mix(options_.seed, std::uint64_t(std::uint32_t(g[0])), std::uint64_t(std::uint32_t(g[1])),
                   std::uint64_t(std::uint32_t(g[2])), what);
    }
    // What geometry alone decides: of an earlier lattice, where it is known from there.
    template <class... T> bool recall(std::uint64_t key, T&... values) const {
        const auto bytes = air_.memo ? air_.memo->find(key, {}) : std::nullopt;
        if (!bytes) return false;
        ByteReader r(*bytes);
        r(values...);
        return true;
    }
    template <class... T> void keep(std::uint64_t key, const T&... values) const {
        if (!air_.memo) return;
        ByteWriter w;
        w(values...);
        air_.memo->keep(key, {}, {}, w.bytes);
    }
    void lay_out();
    void sample(Work& work) const;
    void look(Work& work) const;
    void settle_cells(std::size_t begin, std::size_t end);
    void shape(std::size_t first);
    void light_sites();
    void measure(Work& work) const;
    void measure_cells();
    struct Sums {
        double error = 0, variance = 0, air = 0;
    };
    Sums sums() const;
    std::vector<std::size_t> worst_cells() const;
    void split(std::size_t w);
    double mean_error2() const;
    Ambient finish() const;
};

void Builder::lay_out() {
    const double coarsest = std::max(options_.coarsest, 1.0);
    const double finest = std::clamp(options_.finest, 1.0, coarsest);
    const int levels = std::clamp(static_cast<int>(std::lround(std::log2(coarsest / finest))), 0, 12);
    finest_ = std::ldexp(coarsest, -levels);
    root_ = 1 << levels;
    const double offset = options_.lattice_offset * finest_;
    for (;; root_ *= 2) {
        const double root = finest_ * root_;
        double cells = 1;
        for (std::size_t a = 0; a < 3; ++a) {
            const double lo = std::floor((air_.bounds.lo[a] - offset) / root);
            const double n = std::floor((air_.bounds.hi[a] - offset) / root) - lo + 1;
            origin_[a] = lo * root + offset;
            count_[a] = static_cast<std::uint32_t>(std::min(n, 1e9));
            cells *= n;
        }
        if (cells <= 32768 || root_ >= 1 << 24) break;
    }
}

// Points of the air: one in every stratum of the cell; one in every leaf that no stratum met; and, since a wall may
// leave just a sliver of the cell on its far side, those on the cell's faces that the stratum's point cannot see. Of a
// cell that hardly reaches into the map the strata meet nothing, and walls of detail cut no leaves: so places beside
// the faces in the cell, too, that no sample near them sees.
void Builder::sample(Work& work) const {
    const Box3 box = box_of(work);
    const std::vector<AirPart> parts = air_.parts(box);
    if (parts.empty()) return;
    const std::size_t n = work.size == 1 ? 2 : work.size == 2 ? 3 : 4, times = work.size == 1 ? 2 : 1;
    const double side = finest_ * work.size, stratum = side / double(n);
    const double inset = side / 4096;
    const std::uint64_t stream = seed(work.at, std::uint64_t(work.size));
    std::vector<std::uint32_t> met;
    std::vector<Vec3> onto;
    std::vector<std::uint8_t> clear; // seen from the stratum's point
    const auto take = [&](Vec3 p, double volume) {
        const std::uint32_t leaf = air_.leaf_of(p);
        if (leaf == kNoLeaf) return false;
        work.samples.push_back({p, volume});
        met.push_back(leaf);
        return true;
    };
    for (std::size_t i = 0; i < n * n * n * times; ++i) {
        const std::array<std::size_t, 3> at{i % n, i / n % n, i / (n * n) % n};
        Vec3 p;
        for (std::size_t a = 0; a < 3; ++a)
            p[a] = box.lo[a] + stratum * (double(at[a]) + unit(mix(stream, std::uint64_t(i), std::uint64_t(a))));
        const bool in_air = take(p, stratum * stratum * stratum / double(times));
        if (in_air) work.volume += work.samples.back().volume;
        onto.clear();
        for (unsigned axes = 1; axes < 8; ++axes) { // onto a face, an edge, a corner of the cell
            Vec3 q = p;
            bool at_border = true;
            for (std::size_t a = 0; a < 3; ++a) {
                if (!(axes >> a & 1)) continue;
                at_border = at_border && (at[a] == 0 || at[a] + 1 == n);
                q[a] = at[a] == 0 ? box.lo[a] + inset : box.hi[a] - inset;
            }
            if (at_border) onto.push_back(q);
        }
        clear.assign(onto.size(), 0);
        if (in_air && work.samples.size() < kMaxSamples) air_.clear_each(std::vector<Vec3>(onto.size(), p), onto, clear), work.rays += onto.size();
        for (std::size_t k = 0; k < onto.size() && work.samples.size() < kMaxSamples; ++k) {
            if (clear[k]) work.border.push_back(onto[k]);
            else take(onto[k], 0);
        }
    }
    std::sort(met.begin(), met.end());
    for (std::size_t k = 0; k < parts.size() && work.samples.size() < kMaxSamples; ++k) {
        const Box3& bounds = parts[k].bounds;
        if (std::binary_search(met.begin(), met.end(), parts[k].leaf)) continue;
        for (std::uint64_t t = 0; t < 16; ++t) {
            Vec3 p;
            for (std::uint64_t a = 0; a < 3; ++a)
                p[a] = bounds.lo[a] + bounds.size()[a] * unit(mix(stream, 1000 + t, a, std::uint64_t(parts[k].leaf)));
            if (air_.leaf_of(p) != parts[k].leaf) continue;
            const double volume = bounds.size().x * bounds.size().y * bounds.size().z / double(t + 1);
            work.samples.push_back({p, volume});
            work.volume += volume;
            break;
        }
    }
    if (air_.beside_faces) {
        const std::vector<Vec3> places = air_.beside_faces(box, {});
        const std::size_t count = std::min(places.size(), kMostPlaces);
        std::vector<std::pair<double, std::size_t>> near;
        for (std::size_t k = 0; k < count; ++k) {
            const Vec3 p = places[k * places.size() / count];
            bool in_box = true;
            for (std::size_t a = 0; a < 3; ++a) in_box = in_box && p[a] > box.lo[a] && p[a] < box.hi[a];
            if (!in_box || air_.leaf_of(p) == kNoLeaf) continue;
            near.clear();
            for (std::size_t i = 0; i < work.samples.size(); ++i) {
                const Vec3 way = work.samples[i].point - p;
                near.emplace_back(kiln::dot(way, way), i);
            }
            const std::size_t asked = std::min(near.size(), kAsked);
            std::partial_sort(near.begin(), near.begin() + std::ptrdiff_t(asked), near.end());
            bool seen = false;
            for (std::size_t i = 0; i < asked && !seen; ++i) ++work.rays, seen = air_.clear(p, work.samples[near[i].second].point);
            if (seen) work.border.push_back(p);
            else if (work.samples.size() < kMaxSamples) work.samples.push_back({p, 0});
        }
    }
    work.state = work.samples.empty() ? State::no_air : State::cell;
}

// Which corners its air may use; or that it must be split to know.
void Builder::look(Work& work) const {
    std::vector<Vec3> points, border = std::move(work.border);
    std::vector<std::uint8_t> sees;
    std::vector<Vec3> from, to;
    std::vector<std::uint8_t> clear;
    const auto corners_from = [&](Vec3 p, std::uint8_t asked = 0xFF) {
        std::array<unsigned, 8> corner{};
        to.clear();
        for (unsigned c = 0; c < 8; ++c)
            if (const Site& site = sites_[work.corners[c]]; asked >> c & 1 && site.usable) corner[to.size()] = c, to.push_back(site.position);
        from.assign(to.size(), p);
        air_.clear_each(from, to, clear);
        work.rays += to.size();
        std::uint8_t mask = 0;
        for (std::size_t k = 0; k < to.size(); ++k)
            if (clear[k]) mask |= std::uint8_t(1u << corner[k]);
        return mask;
    };
    const auto sees_all = [&](Vec3 p, std::uint8_t corners) { return corners_from(p, corners) == corners; };
    for (const Sample& s : work.samples) points.push_back(s.point), sees.push_back(corners_from(s.point));
    const bool finest = work.size == 1;
    const auto values = [&] {
        auto sorted = sees;
        std::sort(sorted.begin(), sorted.end());
        return std::unique(sorted.begin(), sorted.end()) - sorted.begin();
    };
    // No corner is usable, and neither would be the air itself, as in a hollow behind terrain: nobody is in it, and one place that sees all of it answers for it.
    if (!finest && std::ranges::all_of(sees, [](std::uint8_t s) { return s == 0; })) {
        const Vec3 middle = box_of(work).center();
        const Vec3 inside = *std::ranges::min_element(points, {}, [&](Vec3 p) { return kiln::dot(p - middle, p - middle); });
        const auto sees_each = [&](const std::vector<Vec3>& all) {
            air_.clear_each(std::vector<Vec3>(all.size(), inside), all, clear);
            work.rays += all.size();
            return std::ranges::all_of(clear, [](std::uint8_t c) { return c != 0; });
        };
        if (sees_backs(air_, inside, work.rays) && sees_each(points) && sees_each(border)) {
            Variant& alone = work.variants.emplace_back();
            alone.mask = 0xFF, alone.own = 0;
            work.own.push_back(inside);
            return;
        }
    }
    Sides sides;
    Blocked blocked;
    for (int round = 0;; ++round) {
        if (!finest && values() > 2) { // no one plane makes it single-valued
            work.state = State::split;
            return;
        }
        sides = separate(air_, points, sees, finest ? kMostSides : 2, blocked);
        work.rays += sides.rays;
        if (!finest && !sides.single_valued()) {
            work.state = State::split;
            return;
        }
        if (values() == 1 || round == kMostRounds) break;
        // Walls cross the cell: slivers between them may hold no sample yet. Those border points that see something
        // else than the side they fall to join the samples.
        std::vector<Vec3> odd;
        const auto fits = [&](Vec3 q, const Side& side) {
            if (side.common) return sees_all(q, side.common);
            return std::ranges::any_of(side.samples, [&](std::uint32_t s) { return ++work.rays, air_.clear(q, points[s]); });
        };
        for (const Vec3& q : border)
            if (!fits(q, sides.sides[side_at(sides.sides, q)])) odd.push_back(q);
        // Air of another kind in a side's region has a wall between, with a face in that region.
        if (air_.beside_faces) {
            std::vector<std::pair<std::uint32_t, std::vector<HalfSpace>>> open{{0, {}}};
            while (!open.empty()) {
                const auto [at, within] = std::move(open.back());
                open.pop_back();
                const Side& side = sides.sides[at];
                auto behind = within;
                if (side.has_plane) {
                    auto beyond = within;
                    behind.push_back({side.normal, side.distance}), beyond.push_back({-side.normal, -side.distance});
                    open.emplace_back(side.beyond, std::move(beyond));
                    if (side.behind) {
                        open.emplace_back(side.behind, std::move(behind));
                        continue;
                    }
                }
                const std::vector<Vec3> places = air_.beside_faces(box_of(work), behind);
                const std::size_t count = std::min(places.size(), kMostPlaces);
                for (std::size_t k = 0; k < count; ++k) {
                    const Vec3 q = places[k * places.size() / count];
                    if (side_at(sides.sides, q) == at && air_.leaf_of(q) != kNoLeaf && !fits(q, side)) odd.push_back(q);
                }
            }
        }
        if (odd.empty()) break;
        constexpr std::size_t kAtOnce = 24;
        const std::size_t n = std::min(odd.size(), kAtOnce);
        for (std::size_t k = 0; k < n; ++k) {
            const Vec3 q = odd[k * odd.size() / n];
            points.push_back(q), sees.push_back(corners_from(q));
        }
        border = std::move(odd);
    }
    for (const Side& side : sides.sides) {
        Variant v; // shape() finds its sites
        v.mask = side.common, v.has_plane = side.has_plane, v.normal = side.normal, v.distance = side.distance;
        v.beyond = side.beyond, v.behind = side.behind;
        if (!v.behind && !v.mask) { // the place that sees most of this side's air answers for all of it
            std::size_t best = 0, best_seen = 0;
            for (std::size_t i = 0; i < side.samples.size(); ++i) {
                std::size_t seen = 1;
                for (const std::uint32_t s : side.samples)
                    seen += s != side.samples[i] && air_.clear(points[side.samples[i]], points[s]);
                work.rays += side.samples.size();
                if (seen > best_seen) best = side.samples[i], best_seen = seen;
            }
            v.mask = 0xFF, v.own = static_cast<std::uint32_t>(work.own.size());
            work.own.push_back(points[best]);
        }
        work.variants.push_back(v);
    }
}

void Builder::split(std::size_t w) {
    work_[w].state = State::split;
    work_[w].variants.clear(), work_[w].own.clear(), work_[w].samples.clear();
    work_[w].first_child = static_cast<std::int32_t>(work_.size());
    const Work parent = work_[w];
    const std::int32_t half = parent.size / 2;
    for (std::int32_t c = 0; c < 8; ++c) {
        Work child;
        child.size = half;
        child.at = {parent.at[0] + (c & 1) * half, parent.at[1] + (c >> 1 & 1) * half, parent.at[2] + (c >> 2) * half};
        work_.push_back(std::move(child));
    }
}

// Cells of a round, in order: what of them is air, their corners, and which of those their air may use.
void Builder::settle_cells(std::size_t begin, std::size_t end) {
    const std::size_t first_site = sites_.size();
    const auto key = [&](const Work& w) { return seed(w.at, mix(0x73u, std::uint64_t(w.size))); };
    parallel_for(context_, end - begin, [&](std::size_t i) {
        Work& w = work_[begin + i];
        w.known = recall(key(w), w.state, w.samples, w.volume, w.variants, w.own, w.rays);
        if (!w.known) sample(w);
    });
    for (std::size_t w = begin; w < end; ++w) {
        Work& work = work_[w];
        if (work.state == State::no_air) continue;
        for (std::int32_t c = 0; c < 8; ++c) {
            const Grid g{work.at[0] + (c & 1) * work.size, work.at[1] + (c >> 1 & 1) * work.size,
                         work.at[2] + (c >> 2) * work.size};
            const auto [at, fresh] = corner_.try_emplace(g, static_cast<std::uint32_t>(sites_.size()));
            if (fresh) {
                Site site;
                site.position = place(g), site.seed = seed(g, 0);
                sites_.push_back(std::move(site));
            }
            work.corners[static_cast<std::size_t>(c)] = at->second;
        }
    }
    parallel_for(context_, sites_.size() - first_site, [&](std::size_t i) {
        Site& s = sites_[first_site + i];
        if (recall(mix(s.seed, 0x74u), s.position, s.usable, s.invalid_share, s.rays)) return;
        settle(air_, finest_ / 2, s);
        keep(mix(s.seed, 0x74u), s.position, s.usable, s.invalid_share, s.rays);
    });
    parallel_for(context_, end - begin, [&](std::size_t i) {
        Work& w = work_[begin + i];
        if (w.known) return;
        if (w.state == State::cell) look(w);
        std::erase_if(w.samples, [&](const Sample& s) { return w.state != State::cell || !(s.volume > 0); });
        w.samples.shrink_to_fit();
        keep(key(w), w.state, w.samples, w.volume, w.variants, w.own, w.rays);
    });
}

// Settles all cells from index `first` on, splitting where visibility asks for it, one level after the other.
void Builder::shape(std::size_t first) {
    // At once: points that a cell is looked at by are some thousand bytes, and millions of cells come in one round where terrain goes on for miles.
    constexpr std::size_t kAtOnce = 16384;
    while (first < work_.size()) {
        const std::size_t last = work_.size();
        for (std::size_t begin = first; begin < last; begin += kAtOnce) settle_cells(begin, std::min(last, begin + kAtOnce));
        for (std::size_t w = first; w < last; ++w) {
            if (work_[w].state == State::split) {
                split(w);
                continue;
            }
            for (Variant& v : work_[w].variants) {
                v.sites.fill(UINT32_MAX);
                if (v.behind) continue;
                if (v.own == UINT32_MAX) {
                    for (unsigned c = 0; c < 8; ++c)
                        if (v.mask >> c & 1) v.sites[c] = work_[w].corners[c];
                    continue;
                }
                Site site;
                site.position = work_[w].own[v.own], site.usable = true;
                site.seed = seed(work_[w].at, 1 + std::uint64_t(v.own) + (std::uint64_t(work_[w].size) << 8));
                v.sites.fill(static_cast<std::uint32_t>(sites_.size()));
                sites_.push_back(std::move(site));
            }
            std::vector<Variant>& variants = work_[w].variants; // whoever does not know of `behind` gets a part there
            for (std::size_t k = variants.size(); k-- > 0;)
                if (Variant& v = variants[k]; v.behind) v.mask = variants[v.behind].mask, v.sites = variants[v.behind].sites;
        }
        first = last;
    }
}

void Builder::light_sites() {
    std::vector<char> used(sites_.size(), 0);
    for (const Work& work : work_)
        if (work.state == State::cell)
            for (const Variant& v : work.variants)
                for (unsigned c = 0; c < 8; ++c)
                    if (v.mask >> c & 1) used[v.sites[c]] = 1;
    std::vector<std::uint32_t> dark;
    for (std::uint32_t s = 0; s < sites_.size(); ++s)
        if (used[s] && !sites_[s].lit) dark.push_back(s);
    parallel_for(context_, "ambient", dark.size(), [&](std::size_t i) { light_up(air_, options_, sites_[dark[i]]); });
    if (floor2_ < 0) {
        double sum = 0;
        std::size_t n = 0;
        for (const Site& site : sites_)
            if (site.lit) {
                sum += std::sqrt(dot(site.shown, site.shown)), ++n;
            }
        const double level = n ? sum / double(n) : 0;
        floor2_ = std::max(kFloor * level * kFloor * level, 1e-30);
    }
    // More rays where the two halves still disagree by more than half of what may be wrong.
    const double allowed = options_.error_percent / 100 / 2;
    parallel_for(context_, dark.size(), [&](std::size_t i) {
        Site& site = sites_[dark[i]];
        while (site.gathered.rays < kMostRays * options_.rays) {
            if (site.gathered.noise2() <= allowed * allowed * (dot(site.shown, site.shown) + floor2_)) break;
            const std::uint32_t more = site.gathered.rays;
            gather(air_, site.position, more, site.seed, site.gathered);
            site.rays += more;
            site.compose(options_);
        }
    });
}

// Relative squared error of the interpolated cube over the cell's air. The cube evaluated at a point carries noise
// of its own; with two independent halves a, b of it, (i - a).(i - b) has the squared error as its mean.
void Builder::measure(Work& work) const {
    const std::size_t most = work.size == 1 ? kErrorPointsFinest : kErrorPoints;
    double truth2 = 0, shown2 = 0, squares = 0;
    work.error2 = work.noise2 = 0;
    const std::size_t n = std::min(most, work.samples.size());
    const Vec3 lo = place(work.at);
    for (std::size_t k = 0; k < n; ++k) {
        const std::size_t i = (2 * k + 1) * work.samples.size() / (2 * n); // spread over the cell
        const Vec3 p = work.samples[i].point;
        const Variant* v = &work.variants[side_at(work.variants, p)];
        const auto weights = cell_weights(lo, finest_ * work.size, v->mask, p);
        Cube6 shown{};
        double noise = 0;
        for (unsigned c = 0; c < 8; ++c) {
            if (!(weights[c] > 0)) continue;
            const Site& site = sites_[v->sites[c]];
            shown = shown + site.shown * weights[c];
            noise += weights[c] * weights[c] * site.gathered.noise2();
        }
        Gathered truth;
        const std::uint64_t stream = mix(seed(work.at, std::uint64_t(work.size)), 0x7275u, std::uint64_t(i));
        gather(air_, p, kErrorRays, stream, truth);
        work.rays += kErrorRays;
        Cube6 lights{};
        if (air_.light_count) {
            double level = 0;
            for (const Rgbd& e : truth.mean()) level += mean(e) / 6;
            for (const LitBy& light : reaching_lights(air_, p, stream, level, work.rays)) {
                double outside = 0; // share that the corners leave to the run time
                for (unsigned c = 0; c < 8; ++c)
                    if (weights[c] > 0 && sites_[v->sites[c]].local(light.light, options_)) outside += weights[c];
                add(lights, light.direct.direction, light.direct.irradiance * (1 - outside));
            }
        }
        const Cube6 ea = shown - truth.a - lights, eb = shown - truth.b - lights, la = truth.a + lights, lb = truth.b + lights;
        // Summed over the cell before dividing: where few rays find a small bright opening by luck, error and level
        // rise together, and a mean of their ratios would come out far too low (measured: 5 % for 16 %).
        const double volume = work.samples[i].volume;
        work.error2 += volume * dot(ea, eb), work.noise2 += volume * noise;
        squares += volume * dot(ea, eb) * volume * dot(ea, eb);
        truth2 += volume * (dot(la, lb) + floor2_), shown2 += volume * (dot(shown, shown) + floor2_);
    }
    if (const double norm2 = std::max(truth2, shown2); norm2 > 0) {
        const double m = double(n), rest = std::max(0.0, squares - work.error2 * work.error2 / m);
        work.spread = rest * m / std::max(1.0, m - 1) / (norm2 * norm2);
        work.error2 /= norm2, work.noise2 /= norm2;
    }
}

// Finest cells are measured for the estimate alone: some of them tell of all.
void Builder::measure_cells() {
    std::vector<std::size_t> fresh, finest;
    for (std::size_t w = 0; w < work_.size(); ++w) {
        if (work_[w].state != State::cell || work_[w].measured) continue;
        work_[w].measured = true, work_[w].stands_for = work_[w].volume;
        (work_[w].size == 1 && work_[w].volume > 0 ? finest : fresh).push_back(w);
    }
    const auto order = [&](std::size_t w) { return std::pair(seed(work_[w].at, 0x66u), w); };
    std::ranges::sort(finest, {}, order);
    const std::size_t asked = std::min(finest.size(), std::max(kErrorCellsFinest, finest.size() / kErrorShareFinest));
    double all = 0, told = 0;
    for (std::size_t k = 0; k < finest.size(); ++k) (k < asked ? told : all) += work_[finest[k]].volume;
    all += told;
    for (std::size_t k = 0; k < finest.size(); ++k) {
        Work& work = work_[finest[k]];
        work.stands_for = k < asked ? work.volume * (all / told) : 0;
        if (k < asked) fresh.push_back(finest[k]);
    }
    std::ranges::sort(fresh);
    parallel_for(context_, "ambient", fresh.size(), [&](std::size_t i) { measure(work_[fresh[i]]); });
}

// Sums over the air: of relative squared error, of the variance of that sum, and of the air.
Builder::Sums Builder::sums() const {
    double finest = 0, finest_air = 0;
    for (const Work& work : work_)
        if (work.state == State::cell && work.size == 1) finest += work.error2 * work.stands_for, finest_air += work.stands_for;
    Sums s;
    for (const Work& work : work_) {
        if (work.state != State::cell) continue;
        s.error += work.error2 * work.stands_for, s.air += work.stands_for;
        // One that stands for others, too, differs from them.
        const double off = work.stands_for > work.volume ? work.error2 - finest / finest_air : 0;
        s.variance += std::max(work.spread, off * off) * work.stands_for * work.stands_for;
    }
    return s;
}

double Builder::mean_error2() const {
    const Sums s = sums();
    return s.air > 0 ? std::max(s.error + std::sqrt(s.variance), 0.0) / s.air : 0;
}

// The cells of most error times volume, as many as hold what is above the target. Noise of the cubes themselves
// does not count: smaller cells do not mend it.
std::vector<std::size_t> Builder::worst_cells() const {
    const double target = options_.error_percent / 100;
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t w = 0; w < work_.size(); ++w) {
        const Work& work = work_[w];
        if (work.state != State::cell) continue;
        const double gain = (work.error2 - work.noise2) * work.volume;
        if (work.size > 1 && gain > 0) order.emplace_back(gain, w);
    }
    std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
        return a.first != b.first ? a.first > b.first : a.second < b.second;
    });
    const Sums all = sums();
    double excess = all.error - target * target * all.air + std::sqrt(all.variance); // else the loop would stop at the first estimate that comes out low by chance
    std::vector<std::size_t> worst;
    for (const auto& [gain, w] : order) {
        if (excess <= 0) break;
        excess -= gain;
        worst.push_back(w);
    }
    std::sort(worst.begin(), worst.end());
    return worst;
}

Ambient Builder::run() {
    if (air_.bounds.empty()) return {};
    lay_out();
    for (std::uint32_t z = 0; z < count_[2]; ++z)
        for (std::uint32_t y = 0; y < count_[1]; ++y)
            for (std::uint32_t x = 0; x < count_[0]; ++x) {
                Work work;
                work.size = root_;
                work.at = {std::int32_t(x) * root_, std::int32_t(y) * root_, std::int32_t(z) * root_};
                work_.push_back(std::move(work));
            }
    shape(0);
    light_sites();
    measure_cells();
    for (std::vector<std::size_t> worst; !(worst = worst_cells()).empty();) { // each round splits: it ends at the finest
        const std::size_t first = work_.size();
        for (const std::size_t w : worst) split(w);
        shape(first);
        light_sites();
        measure_cells();
    }
    return finish();
}

Ambient Builder::finish() const {
    Ambient out;
    out.origin = origin_, out.root_size = static_cast<float>(finest_ * root_), out.root_count = count_;
    out.error_estimate = 100 * std::sqrt(mean_error2()); // one standard error on the safe side
    for (const Work& work : work_) out.rays += work.rays;
    for (const Site& site : sites_) out.rays += site.rays;
    std::vector<std::uint32_t> cube_of(sites_.size(), UINT32_MAX);
    const auto emit_cells = [&](const Work& work) {
        const auto first = static_cast<std::uint32_t>(out.cells.size());
        for (std::size_t k = 0; k < work.variants.size(); ++k) {
            const Variant& v = work.variants[k];
            AmbientCell cell;
            cell.lo = place(work.at), cell.size = static_cast<float>(finest_ * work.size), cell.mask = v.mask;
            cell.cubes.fill(UINT32_MAX);
            for (unsigned c = 0; c < 8; ++c) {
                if (!(v.mask >> c & 1)) continue;
                std::uint32_t& cube = cube_of[v.sites[c]];
                if (cube == UINT32_MAX) {
                    cube = static_cast<std::uint32_t>(out.cubes.size());
                    const Site& site = sites_[v.sites[c]];
                    AmbientCube& to = out.cubes.emplace_back();
                    to.position = site.position, to.invalid_share = site.invalid_share;
                    for (std::size_t f = 0; f < 6; ++f) to.irradiance[f] = Rgb(site.shown[f]);
                    for (std::size_t i = 0; i < site.locals(options_); ++i) to.local_lights.push_back(site.lights[i].light);
                }
                cell.cubes[c] = cube;
            }
            if (v.has_plane) {
                cell.plane_normal = v.normal, cell.plane_distance = v.distance;
                cell.beyond = first + v.beyond;
                if (v.behind) cell.behind = first + v.behind;
            }
            out.cells.push_back(cell);
        }
        return -static_cast<std::int32_t>(first) - 1;
    };
    // Breadth first: roots, then groups of eight in the order of their parents.
    std::vector<std::size_t> order(std::size_t(count_[0]) * count_[1] * count_[2]);
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    for (std::size_t i = 0; i < order.size(); ++i) {
        const Work& work = work_[order[i]];
        std::int32_t node = INT32_MIN;
        if (work.state == State::split) {
            node = static_cast<std::int32_t>(order.size());
            for (int c = 0; c < 8; ++c) order.push_back(static_cast<std::size_t>(work.first_child + c));
        } else if (work.state == State::cell) {
            node = emit_cells(work);
        }
        out.tree.push_back(node);
    }
    return out;
}

} // namespace

Ambient build_lattice(const Air& air, const AmbientOptions& options, Context& context) {
    AmbientOptions sane = options;
    sane.rays = std::max(2u, std::bit_floor(std::clamp(options.rays, 16u, 65536u)));
    return Builder(air, sane, context).run();
}

} // namespace kiln::ambient
