// The working state of one bake; private to this folder. The steps stand in the order they are taken.
#pragma once
#include "compiler/light/emitters.h"
#include "compiler/light/kernels.h"
#include "compiler/light/memo.h"
#include "compiler/light/patches.h"
#include "compiler/light/sight.h"
#include "compiler/light/spots.h"
#include "libs/core/grouped.h"
#include "libs/core/held.h"
#include "libs/sampling/maps.h"
#include <atomic>
#include <functional>
#include <span>

namespace kiln {

// Codes in hit lists beside patch numbers.
constexpr std::uint32_t kHitEscaped = UINT32_MAX, kHitBack = UINT32_MAX - 1, kHitBlack = UINT32_MAX - 2;
constexpr std::uint32_t kHitPanes = UINT32_MAX - 3;     // several: see PaneRays
constexpr std::uint32_t kHitEmitter = 1u << 31; // | emitter: shines but is no patch (sky)
constexpr bool is_patch(std::uint32_t hit) {
    return hit < kHitEmitter;
}

// Reflected radiance at hits: luxel by luxel where a texel belongs to one patch, else by patch.
struct ReflectedLight {
    std::vector<Rgb> texel, patch;
    std::vector<Rgb> direct;         // the part of `texel` that explicit direct light makes, as the solution has it
    std::vector<std::uint8_t> steep; // per texel: that part changes much towards the texels beside it; as the solution has these
    // Per patch: what its row met at patches far off and at emitters far off that have no rays of their own there, the mean of those rays; below 0: none did.
    std::vector<Rgb> far;
    // Per patch: what is far is told by distances between places, less what a face that is one patch reaches from its own; from where on it is,
    // with its own reach.
    std::vector<Vec3> place;
    std::vector<double> reach, far_from;
    bool is_beyond(std::size_t patch, Vec3 what, double size) const {
        const Vec3 d = what - place[patch];
        const double r = far_from[patch] + size;
        return dot(d, d) > r * r;
    }
};

// A lamp changed in one room changes the last digits of the light of every other. What rays read is rounded, up or down by the place, so that means do not
// change: it is mostly the same where nothing much happened, and what was made of it can be taken over.
double read_step_of(double error_percent); // share of light, a power of two
Rgbd rounded_as_read(Rgbd light, double step_share, double floor, double up); // floor: what darker light is rounded as; up: from which remainder on, 0 all to 1 none

// A light that is sampled explicitly for the luxels of a patch; all others it sees stay in the gathered rays.
struct LightRef {
    std::uint32_t light = 0; // emitter, or light entity
    bool is_emitter = false;
    bool penumbra = false;     // some test rays saw it and some did not, here or at a neighbour
    bool hidden = false;       // no test ray saw it (entities only: they cannot be left to gathered rays)
    std::uint16_t samples = 1; // per luxel where it is not in full view, at an effort of 1
    bool filtered = false;     // some test ray came through a pane, here or at a neighbour
    template <class A> void fields(A& a) { a(light, is_emitter, penumbra, hidden, samples, filtered); }
};

struct HitCounts {
    static constexpr bool kRawBytes = true;
    std::uint64_t rays = 0, escaped = 0, back = 0;
    HitCounts& operator+=(const HitCounts& o) {
        rays += o.rays, escaped += o.escaped, back += o.back;
        return *this;
    }
};

struct Quality {                        // what the error target buys; tuned in NOTES.md
    double patch_size = 32;             // map units
    std::uint32_t row_rays = 256;       // per patch
    std::uint32_t visibility_rays = 16; // per patch and candidate light
    std::uint32_t direct_samples = 4;   // per luxel and light at first; more where that is too noisy
    double promotion = 0.005;   // an emitter whose predicted noise exceeds this share of E is sampled explicitly (but see Bake::threshold)
    double light_cutoff = 5e-3; // entity lights that together bring less than this share of E are left out
    std::uint32_t first_rays = 64, most_rays = 4096; // per luxel: of the first pass; where it is noisy
    double iteration = 1e-3;                         // bound on the relative iteration error
    double read_step = 0;                            // a power of two: to what share of itself light is rounded where rays read it
    static Quality of(const LightOptions& options);
};

// Directions on the primary square: concentric disc, then density (2 a z + 1 - a) / (2 pi). a = 1: cosine. Kernels
// that do not fall with the cosine want a < 1, or light at grazing angles gets unbounded weight.
struct HemisphereMap {
    double a = 1;
    Vec3 direction(Vec2 square) const { return lifted(concentric_disc(square)); }
    Vec3 lifted(Vec2 d) const { // from the disc
        const double r2 = dot(d, d), u = std::max(0.0, 1 - r2);
        if (a >= 1) return {d.x, d.y, std::sqrt(u)};
        // Solve a z^2 + (1 - a) z = u.
        const double z = 2 * u / ((1 - a) + std::sqrt((1 - a) * (1 - a) + 4 * a * u));
        const double s = r2 > 0 ? std::sqrt(std::max(0.0, 1 - z * z) / r2) : 0;
        return {d.x * s, d.y * s, z};
    }
    Vec2 square(Vec3 way) const; // of a direction above the horizon
    double density(double z) const { return (2 * a * z + 1 - a) * 0.15915494309189535; }
    // Where a cosine-distributed point of the square would have to lie for this map to give the same direction.
    Vec2 from_cosine(Vec2 square) const {
        if (a >= 1) return square;
        const Vec2 c{2 * square.x - 1, 2 * square.y - 1};
        const double r = std::max(std::abs(c.x), std::abs(c.y));
        if (!(r > 0)) return square;
        const double z = std::sqrt(std::max(0.0, 1 - r * r));
        const double scale = std::sqrt(std::max(0.0, 1 - (a * z + 1 - a) * z)) / r;
        return {(c.x * scale + 1) / 2, (c.y * scale + 1) / 2};
    }
};

// 16 x 16 histogram on the primary square, mixed with a uniform share so that nothing can be missed.
class Guide {
public:
    static constexpr int kSide = 16;
    static constexpr double kUniformShare = 0.35;
    void clear();
    static std::uint8_t cell(Vec2 square) {
        const auto at = [](double x) { return std::clamp(static_cast<int>(x * kSide), 0, kSide - 1); };
        return static_cast<std::uint8_t>(at(square.x) * kSide + at(square.y));
    }
    void add(std::uint8_t cell, double light) { cell_[cell] += light; }
    void build();                               // blurs, normalises, mixes
    // After that: a rectangle of the square gets a share of the samples for itself; all shares together less than 1.
    void add_spot(Vec2 lo, Vec2 hi, double share);
    Vec2 sample(Vec2 u, double* density) const; // density: of the primary square, >= kUniformShare, or its square where there are spots

private:
    Vec2 sample_cells(Vec2 u, double* density) const;
    double density_of_cell(std::size_t x, std::size_t y) const { return uniform_ ? 1 : (row_[x][y + 1] - row_[x][y]) * kSide * kSide / marginal_[kSide]; }
    struct Rectangle {
        Vec2 lo, hi;
        double share = 0;
    };
    std::array<double, kSide * kSide> cell_{};
    std::array<double, kSide + 1> marginal_{};
    std::array<std::array<double, kSide + 1>, kSide> row_{};
    bool uniform_ = true;
    std::vector<Rectangle> spots_;
    double spot_share_ = 0;
};

struct LuxelGather {
    static constexpr bool kRawBytes = true;
    KernelSum sum;
    std::array<double, 4> variance{}; // of what is shown (LuxelKernel::shown), from quarters of the sequence: an upper bound
    HitCounts hits;
};

// What rays of the rows met that crossed panes: the panes, and what stands behind them.
struct PaneRays {
    struct Met {
        static constexpr bool kRawBytes = true;
        std::uint32_t code = kHitBlack; // as of hit lists
        Rgb reflected, emitted;         // share of its reflected and of its own light that arrives
    };
    std::vector<std::uint64_t> ray; // into hit lists, ascending
    std::vector<std::uint64_t> first; // into `met`; one more than rays
    std::vector<Met> met;
    std::span<const Met> of(std::uint64_t r) const {
        const auto at = static_cast<std::size_t>(std::ranges::lower_bound(ray, r) - ray.begin());
        return {met.data() + first[at], met.data() + first[at + 1]};
    }
    template <class A> void fields(A& a) { a(ray, first, met); }
};

constexpr std::uint64_t kDraw = 5, kRounding = 7, kLook = 10, kHanded = 11; // passes of seed_at
constexpr std::uint32_t kQuarters = 4;
// Of the rays of a row, by quarters of their sequence, those that met something.
struct Quarters {
    static constexpr bool kRawBytes = true;
    std::array<std::uint16_t, kQuarters> rays{};
    std::uint32_t all() const { return std::uint32_t{rays[0]} + rays[1] + rays[2] + rays[3]; }
};

PaneRays joined(std::vector<PaneRays>& parts);
// What slots of a loop have found, in their order.
template <class T> std::vector<T> joined(std::vector<std::vector<T>>& slots) {
    std::vector<T> out;
    for (std::vector<T>& slot : slots) std::ranges::move(slot, std::back_inserter(out));
    return out;
}

// What keys of memos are for.
enum class KeyOf : std::uint64_t { patches = 1, neighbours, beside, seeds, tests, far, clusters, place, seams, matched };

constexpr double kQuarterSpread = 1.35; // quarters of a sequence scatter more than its whole promises
constexpr std::uint32_t kReplicates = 4;
struct PilotGather { // what the rays of a luxel of the pilot gathered, and with them looked up in other solutions (Bake::pilot)
    std::array<StoredSum, kReplicates> fine{}, coarse{}, close{};
    std::vector<StoredSum> tilted; // for the encoding: along the luxel's own normal, and along others
    template <class A> void fields(A& a) { a(fine, coarse, close, tilted); }
};
struct PilotLuxel { // see estimate.cpp
    // Along the normals of LuxelKernel::shown, direct light included.
    std::array<std::array<Rgbd, 4>, kReplicates> value{}, direct{}, to_coarse{}, to_close{};
    std::array<Rgbd, 4> mean_value{};
    std::uint64_t shown = 1;
    double area = 0, representation = 0;
};

class Bake {
public:
    Bake(const World& world, const Bsp& bsp, const Surfaces& surfaces, const std::vector<Light>& lights,
         const LightOptions& options, LightMemo* memo, const Visibility* seen, Context& context);
    Lighting run();

private:
    struct Rows { // merged hit lists: F_ij for patches j, ascending
        Held<std::uint64_t> first;
        Held<std::uint32_t> patch;
        Held<float> weight;
        // Through panes: may be coloured. Empty without them.
        std::vector<std::uint64_t> filtered_first;
        std::vector<std::uint32_t> filtered_patch;
        std::vector<Rgb> filtered_weight;
    };
    // body(patch, factor): a number, or a colour through panes.
    static void for_row(const Rows& rows, std::size_t p, const auto& body) {
        for (std::uint64_t k = rows.first[p]; k < rows.first[p + 1]; ++k) body(rows.patch[k], static_cast<double>(rows.weight[k]));
        if (rows.filtered_first.empty()) return;
        for (std::uint64_t k = rows.filtered_first[p]; k < rows.filtered_first[p + 1]; ++k) body(rows.filtered_patch[k], static_cast<Rgbd>(rows.filtered_weight[k]));
    }
    void make_patches();
    std::vector<Rgbd> solve_patches();
    Rgbd rounded(Rgbd light, double up) const { return rounded_as_read(light, quality_.read_step, floor_, up); }
    // relight.cpp
    void open_memo();
    void name_table();
    // What an earlier bake of this geometry has made under that key, or makes it.
    template <class T, class Make> T known_or(std::uint64_t key, const Make& make) const {
        return kiln::known_or<T>(memo_ ? &memo_->lights : nullptr, key, make);
    }
    const PieceEdges& edges() const;
    std::vector<std::uint64_t> luxel_seeds(std::uint64_t pass) const;
    PatchTable patches_of(double h) const; // of that size
    TouchingPatches touching(const PatchTable& table, Hash name) const;
    bool load_rows();
    void save_rows(const std::array<std::uint64_t, 3>& counts);
    bool load_larger_rows();
    void save_larger_rows();
    void note_reflected(std::uint32_t patch);
    std::uint64_t light_seen(std::uint32_t patch) const;
    void note_solution();
    void note_states();
    std::uint64_t hash_of_ref(const LightRef& ref, bool bright = true) const; // bright: with how bright it is
    void luxel_direct_of(std::uint32_t patch, std::uint64_t pass, std::vector<std::uint32_t>* divided, std::uint64_t* rays);
    std::uint64_t gather_key(std::uint32_t patch) const;
    std::uint64_t key_of(std::uint32_t patch, std::uint64_t hash) const { return key_at(patch, patches_.patches.size(), hash); }
    // rows.cpp
    HitCounts trace_rows();
    void merge_hits();
    void weigh_rows();
    void merge_larger();
    void make_rows();
    // body(code, quarters) for all that a row met that is a patch, or shines.
    void for_met(std::size_t p, auto&& body) const {
        for (std::uint64_t k = rows_.first[p]; k < rows_.first[p + 1]; ++k) body(rows_.patch[k], met_[k]);
        for_lone(p, body);
    }
    void for_lone(std::size_t p, auto&& body) const { // what is no patch
        for (std::uint64_t k = lone_first_[p]; k < lone_first_[p + 1]; ++k) body(lone_[k], lone_met_[k]);
    }
    bool patches_shine() const {
        return std::ranges::any_of(patch_emitter_, [](std::uint32_t e) { return e != UINT32_MAX; });
    }
    // Likewise body(ray) for its rays through panes; their numbers in pane_rays_.ray.
    void for_pane_rays(std::size_t p, const auto& body) const {
        if (pane_rays_.ray.empty() || covered_[p]) return;
        const std::uint64_t m = quality_.row_rays;
        for (auto r = std::ranges::lower_bound(pane_rays_.ray, p * m); r != pane_rays_.ray.end() && *r < (p + 1) * m; ++r) body(*r);
    }
    std::vector<Rgbd> gathered_emission(bool only_unlisted) const;
    std::vector<Rgbd> solve_gathered(const std::vector<Rgbd>& rho);
    std::vector<Rgbd> solve(const Rows& rows, const std::vector<Rgbd>& direct, const std::vector<Rgbd>& rho,
                            std::uint32_t* iterations, double* residual);
    // transmission_rows.cpp
    void note_panes(std::uint64_t ray, Vec3 origin, Vec3 way, double far, const Widths& widths, std::uint32_t& code, PaneRays& out) const;
    std::uint32_t code_at(const SceneHit& hit) const;
    void merge_filtered(Rows& rows) const;
    void merge_filtered_larger();
    std::uint32_t emitter_of(std::uint32_t code) const;
    Rgbd emission_through_panes(std::uint64_t ray, std::uint32_t patch, bool only_unlisted) const;
    double light_through_panes(std::uint64_t ray, std::uint32_t patch) const;
    // Of a ray that crosses the panes and meets `behind`: what they make of that, and their own light.
    Rgbd through_panes(std::span<const PaneHit> panes, Vec3 way, std::uint32_t patch, std::span<const std::uint32_t> heavy, Random& random,
                       const ReflectedLight& light, Looked* looked, int depth, Rgbd behind) const;
    // direct.cpp
    void choose_lights(const std::vector<Rgbd>& irradiance);
    bool listed(std::uint32_t patch, std::uint32_t emitter) const;
    std::uint64_t stream_of(const LightRef& ref) const;
    struct Receiver { // of direct light: a luxel, or a patch
        const Footprint* footprint;
        const LuxelKernel* kernel;
        std::uint64_t seed;
        KernelSum sum{};
        double variance = 0; // of the sum, from its places
    };
    // Adds what a light of the patch's list brings. `closely`: rays decide, whatever the test rays of the patch said; else it is told whether those were wrong about a receiver.
    bool direct_from(const LightRef& ref, std::uint32_t patch, std::span<Receiver> receivers, bool closely, std::uint64_t* rays) const;
    // How bright it is: direct_from asks for the light of a light of brightness 1, which is kept where only that changes.
    Rgbd brightness(const LightRef& ref) const { return ref.is_emitter ? emitters_.emitters[ref.light].radiance : static_cast<Rgbd>(lights_[ref.light].intensity); }
    // `luxel`: UINT32_MAX of a patch.
    void each_direct_at(std::uint32_t patch, std::uint32_t luxel, const Footprint& footprint, const LuxelKernel& kernel, std::uint64_t seed, std::uint64_t* rays, bool closely,
                        const std::function<bool(const LightRef&)>& wanted, const std::function<void(std::size_t, const KernelSum&)>& visit) const;
    KernelSum direct_at(std::uint32_t patch, std::uint32_t luxel, const Footprint& footprint, const LuxelKernel& kernel, std::uint64_t seed, std::uint64_t* rays, bool closely = false) const;
    double threshold(std::uint32_t patch,
                     std::uint32_t emitter) const; // form factor from which on it is worth rays of its own
    bool looks_many_ways(std::uint32_t patch) const;
    double form_factor_bound(std::uint32_t patch, std::uint32_t emitter) const;
    double distance_to(const LightRef& ref, Vec3 x) const;
    std::uint16_t penumbra_samples(double share) const;
    bool receives(std::uint32_t patch) const;
    std::span<const std::uint32_t> luxels_of(std::size_t p) const { return patch_luxels_[p]; }
    // Adds emitters to the lists of patches and of their neighbours; which patches changed.
    struct Found { // of a patch
        std::uint32_t patch = 0;
        std::vector<std::uint32_t> emitters; // or places in its list
    };
    std::vector<std::uint32_t> add_emitters(const std::vector<Found>& found);
    struct Handed { // an emitter that a patch has from one beside it
        std::uint32_t patch = 0, emitter = 0;
        auto operator<=>(const Handed&) const = default;
    };
    std::optional<LightRay> test_ray(std::uint32_t patch, std::uint32_t emitter, const Footprint& footprint, const Sobol& points, std::uint32_t k, std::uint32_t tests) const;
    bool list_emitter(std::uint32_t patch, std::uint32_t emitter, bool met);
    std::vector<std::uint32_t> hand_on(std::vector<Handed> handed);
    std::vector<Found> luxel_direct(std::span<const std::uint32_t> patches);
    void luxel_direct_all();
    std::vector<std::uint32_t> mark_beside(std::span<const std::uint32_t> patches, const std::vector<Found>& divided);
    bool matters(std::uint32_t patch, double light) const;
    std::vector<std::uint32_t> look_closely(std::uint32_t look);
    std::uint32_t pilot_share() const; // one luxel in so many
    // The `which`-th part of the luxels, one in so many. `all`: if given, how many there are to draw from.
    std::vector<std::uint32_t> drawn_luxels(std::uint32_t one_in, std::uint32_t which, std::size_t* all = nullptr) const;
    std::vector<std::uint32_t> share_direct(double measured, double wanted);
    std::vector<Rgbd> patch_direct();
    // gather.cpp
    void patch_guide(std::uint32_t patch, Guide* guide) const;
    // The same rays looked up in another solution, for the estimate of its difference.
    struct Other {
        const ReflectedLight* light = nullptr;
        KernelSum sum;
    };
    // `met`: receives emitters that should have had rays of their own, and leaves their light out; none: it stays
    // in.
    LuxelGather gather(std::uint32_t luxel, const LuxelKernel& kernel, const Guide& guide, const HemisphereMap& map,
                       std::uint32_t rays, std::uint64_t seed, std::vector<std::uint32_t>* met, std::span<Other> others = {}, Looked* looked = nullptr) const;
    enum class Pass { first, again, last };
    std::vector<Found> gather_patches(std::span<const std::uint32_t> patches, Pass pass);
    std::vector<double> single_noise(const std::vector<double>& variance) const;
    std::vector<double> least_cost(std::vector<double> single, double wanted) const;
    std::vector<double> ray_noise() const;
    double expected_noise() const;
    void share_rays(double wanted);
    // spots.cpp
    Clusters clusters_of(std::span<const std::uint32_t> patches) const;
    void plant_spot_trees();
    void find_spots();
    void add_spots(std::uint32_t patch, Guide* guide) const;
    // smooth.cpp
    void smooth();
    std::vector<std::uint8_t> luxels_within(int reach, const std::function<bool(std::uint32_t)>& these) const;
    void each_gathered(const std::function<void(std::uint32_t)>& body);
    KernelSum light_of(std::uint32_t luxel) const; // all of it, as it is baked
    void store_luxels();
    static constexpr int kNearBounces = 4; // of reflected_at
    Choice near_lights_of(std::uint32_t patch) const;
    Rgbd one_light_at(std::uint32_t patch, Vec3 x, Vec3 normal, Random& random) const;
    Rgbd reflected_at(const SceneHit& hit, std::uint32_t texel, Vec3 came, Random& random, const ReflectedLight& light, Looked* looked, int depth) const;
    Rgbd reflected_at(const SceneHit& hit, Vec3 came, Random& random, const ReflectedLight& light, Looked* looked, int depth) const {
        return reflected_at(hit, index_.texel_at(hit.face, hit.position), came, random, light, looked, depth);
    }
    // estimate.cpp
    struct PilotResult {                  // of what is shown along that of the four normals that fares worst
        double noise = 0, bias = 0;       // rRMSE
        double gather = 0, direct = 0;    // the two parts of the noise
        double shortcut = 0;              // of the places where light is not looked at closely
        double square = 0;                // of all these: the mean square error
        double below = 0, above = 0;      // how far from `square` that of the whole bake may lie, each with 99 % as far as it is for the luxels drawn; over all four normals
        double representation = 0;        // of the encoding, over normals of its cone
    };
    bool of_luxels(const Luxel& luxel) const;
    ReflectedLight coarse_luxels() const;
    PilotGather pilot_gather(std::uint32_t luxel, const ReflectedLight& coarse, const ReflectedLight& close, bool rough, bool encoding, Looked* looked) const;
    PilotLuxel pilot_luxel(std::uint32_t luxel, const PilotGather& gathered, bool rough) const;
    // `rough`: noise and patch bias only.
    PilotResult pilot(std::uint32_t one_in, bool rough = false);
    // rRMSE that the noise of the rows makes in gathered light: the same for all luxels that look the same way, so replicates do not see it.
    double solution_noise() const;
    ErrorReport error_report(const PilotResult& check, double solution) const;
    // bake.cpp
    LuxelKernel kernel_of(std::uint32_t luxel) const;
    Footprint footprint_of_patch(std::uint32_t patch) const;
    Footprint footprint_of_luxel(std::uint32_t luxel) const;
    std::uint64_t seed_at(Vec3 point, std::uint64_t pass) const;
    Vec3 luxel_centroid(const Luxel& luxel) const;
    ReflectedLight reflected_light(const std::vector<Rgbd>& rest_of_luxel, const std::vector<Rgbd>& total, const ReflectedLight* same_direct = nullptr) const;
    std::vector<std::uint32_t> own_light(std::vector<double>& stale); // returns patches to which what it changed makes a difference
    Rgbd emitted_by(std::uint32_t p) const { return patch_emitter_[p] == UINT32_MAX ? Rgbd{} : emitters_.emitters[patch_emitter_[p]].radiance; }
    bool is_far(const ReflectedLight& light, std::uint32_t patch, std::uint32_t code) const {
        if (is_patch(code)) return light.is_beyond(patch, light.place[code], light.reach[code]);
        if (code >= kHitPanes) return false;
        const Emitter& e = emitters_.emitters[code & ~kHitEmitter];
        return light.is_beyond(patch, e.center, e.radius);
    }
    void far_light(const Rows& rows, const PatchTable& table, const Grouped& parts, Hash name, double size, ReflectedLight* light) const;
    ReflectedLight coarse_light(const std::vector<Rgbd>& direct, const std::vector<Rgbd>& first);
    void make_larger();
    void fill();
    HemisphereMap map_of(ChartId chart) const;

    const World& world_;
    const Surfaces& surfaces_;
    const std::vector<Light>& lights_;
    const LightOptions& options_;
    const bool sealed_; // nothing may escape: what does starts inside something
    LightMemo* memo_;   // none: nothing is kept
    Context& context_;
    Quality quality_;
    std::uint32_t least_row_rays_ = quality_.row_rays; // more where the noise of the solution asks for it
    Vec3 corner_; // seeds go by places from here
    TraceScene scene_;
    LuxelIndex index_;
    Rgbd sky_; // radiance
    EmitterSet emitters_;
    LightSight sight_;
    mutable std::optional<PieceEdges> edges_; // where they have been asked for: what they make is mostly kept
    PatchTable patches_;
    TouchingPatches touching_;
    Grouped neighbours_;                                 // per patch, ascending: those it shares an edge with, in its plane
    std::vector<std::uint32_t> patch_emitter_;           // per patch; UINT32_MAX: none
    std::vector<Clusters> clusters_;           // per patch: it lies in
    std::vector<std::uint8_t> covered_;        // per patch: it looks into what is solid; nothing is baked there
    Held<std::uint32_t> hits_;                 // row_rays per patch, in ray order
    Held<std::uint8_t> hit_cells_;             // of those rays, in guides of the patch's chart
    PaneRays pane_rays_;
    std::vector<double> estimate_;             // per patch: mean irradiance, everything gathered
    double residual_ = 0;                      // relative, of the last solution
    double floor_ = 0;                         // irradiance below which errors are not relative any more
    std::vector<std::vector<LightRef>> lists_; // per patch: emitters in ascending order, then entities
    std::vector<std::vector<std::uint32_t>> behind_;    // per patch, ascending: large emitters that mostly lie behind something, left to gathered rays
    std::vector<std::vector<float>> brought_;  // per patch and light of its list: mean irradiance of its luxels
    std::vector<Choice> near_lights_;          // per patch: of its list, for a place near it
    std::vector<std::uint32_t> luxel_patch_;   // per luxel: the patch of most of its footprint
    Grouped patch_luxels_;                                        // luxels by that patch
    std::vector<double> luxel_area_;                              // per patch: of those, map units squared
    std::vector<double> luxel_rounding_, patch_rounding_;         // per luxel and patch: see rounded()
    std::vector<std::uint64_t> luxel_draw_;                       // per luxel: by which a pilot draws
    std::vector<KernelSum> direct_;                               // per luxel
    std::vector<float> direct_variance_;                          // per luxel: of its mean, as the spread between places has it
    std::vector<std::uint16_t> effort_;                           // per patch: times the samples of its lights
    std::vector<std::uint32_t> direct_draws_; // per patch: how often its direct light was drawn
    std::uint64_t own_round_ = 0; // of gathering with luxels' own light; 0: not now
    Rows rows_;
    Held<Quarters> met_;                       // per entry of the rows
    Held<std::uint64_t> lone_first_;           // per patch, and one more: into
    Held<std::uint32_t> lone_;                 // what its row met that shines and is no patch: codes as of hits_
    Held<Quarters> lone_met_;
    struct Larger { // patches of twice the size, of which the difference to these tells the error of either
        PatchTable table;
        std::vector<std::uint32_t> of; // of each patch, in which of them it lies
        Grouped parts, neighbours, luxels; // of each of them
        std::vector<double> area;
        Rows rows; // from the rays of the parts
    } larger_;
    std::vector<Rgbd> rest_;                                      // per patch: irradiance that is not direct
    std::vector<Rgbd> solved_direct_;                             // and that which is, as the bounces were solved
    std::vector<std::shared_ptr<const ConeTable>> cones_;         // per chart; none: flat only
    ReflectedLight reflected_;
    std::vector<double> bright_;               // per patch: luminance of what it reflects
    SpotTrees spot_trees_;                     // by the first of the clusters of the patches
    LightSight::Sources spot_sources_;         // the trees
    std::vector<Spot> spots_;
    Grouped patch_spots_;                      // per patch: those it sees, strongest first
    ReflectedLight coarse_;                    // the same averaged over patches of twice the size
    ReflectedLight coarse_luxels_;             // with direct light as luxels of twice the size would show it
    std::vector<StoredSum> gathered_, smoothed_;                  // per luxel: what its rays gathered; with what its neighbours tell
    std::vector<std::array<double, 4>> gathered_variance_;        // of what is shown, by these rays
    std::vector<std::uint8_t> gathered_there_;                    // 0: nothing is known there
    std::vector<std::uint8_t> new_, stirred_;                     // per patch: gathered since neighbours were last asked; they were asked anew then
    std::vector<std::uint8_t> beside_;                            // per luxel: bits of those at x + 1, x - 1, y + 1, y - 1 that go on from it
    std::vector<float> left_;                                     // per luxel: share of the variance that neighbours leave
    std::vector<float> spike_;                                    // per luxel: share of its light that is spread over its neighbours
    std::vector<float> spread_variance_;                          // per luxel: variance that spikes have brought it, summed over the normals
    std::vector<std::uint32_t> rays_;          // per patch: gathered rays of its luxels
    std::vector<double> noise_, noise_weight_; // per patch: relative variance of a single ray, as passes showed it
    // With a memo: that of the patches as they are, what every key begins with, and what a place's light is a function of.
    Hash table_, larger_table_;
    std::uint64_t geometry_ = 0, base_ = 0, pilots_ = 0;                // base_: with the sky
    std::vector<std::uint64_t> light_ids_, light_shapes_;               // per entity: of all that makes its light; but for its intensity
    std::vector<std::uint64_t> reflects_, reflects_coarse_, guides_;    // per patch, from the last solution
    std::vector<std::uint64_t> gathered_hash_;                          // per patch: of what its luxels gathered
    std::vector<std::uint64_t> emitters_hash_;                          // of the emitters in its list
    // Of what rays may read there, kLookedAt times all patches: what it reflects; which emitters are in its list, and the light far off; its list. Then what
    // each emitter sends.
    static constexpr std::uint32_t kLookedAt = 3;
    std::uint32_t emitter_part(std::uint32_t emitter) const { return static_cast<std::uint32_t>(kLookedAt * patches_.patches.size()) + emitter; }
    std::size_t part_count() const { return kLookedAt * patches_.patches.size() + emitters_.emitters.size(); }
    std::vector<std::uint64_t> states_, states_coarse_;
    std::vector<std::uint8_t> untold_; // per patch: something of it has changed since its states were told
    HitCounts counts_;
    std::atomic<std::uint64_t> shadow_rays_{0};
    Lighting out_;
};

// What leaves a hit, in that texel, by reflection.
Rgbd reflected_radiance(const LuxelIndex& index, const PatchTable& patches, const ReflectedLight& light, const SceneHit& hit, std::uint32_t texel, Looked* looked = nullptr);
Rgbd sky_radiance(const std::vector<Light>& lights);
// Of all that makes its light: not the number of its entity.
std::uint64_t light_id(Light light);
// Distance of ray origins from the rim of their footprint, in push-offs: walls that lean over it as far as 6
// degrees from the surface do not swallow them.
constexpr double kBakeMargin = 10;
// The shading normal at a point of a face.
Vec3 shading_normal(const Surfaces& surfaces, FaceId face, Vec3 point);
Frame shading_frame(const Frame& chart, Vec3 normal);
// The frame that directional light is stored in at a point of a face with a chart.
Frame light_frame(const Surfaces& surfaces, FaceId face, Vec3 point);
Frame light_frame(const Chart& chart, const Face& face, Vec3 normal); // by the shading normal there
// Quantiles of the normal distribution.
constexpr double k95Percent = 1.6449, k99Percent = 2.3263;
// How far the mean of all may lie above and below that of a sample with these weights, each with the confidence of `quantile`. `sampled`: the share of all that it is. `measured`: where values are
// measures that are off themselves, the variance of each: that is left though all are sampled.
struct Bounds {
    double above = 0, below = 0;
};
Bounds bounds_of_mean(std::span<const double> value, std::span<const double> weight, double sampled, double quantile = k95Percent, std::span<const double> measured = {});

} // namespace kiln
