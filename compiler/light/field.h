// LightField: a baked scene that can be asked for incoming light anywhere. The luxel pass, ambient cubes, probes,
// `kiln gather` and `kiln reference` all ask it.
#pragma once
#include "compiler/light/light.h"
#include <functional>
#include <memory>
#include <span>

namespace kiln {

struct SceneHit {
    double distance = 0; // map units
    std::uint32_t triangle = 0;
    FaceId face;
    Vec3 position;
    bool back = false; // hit from behind: a leak event in a closed map
    bool sky = false;
};

// A ray stands for a bundle: of the square of width `start` (0: a point) it begins in and that of width `end` where it ends. A texture of holes is
// averaged over what the bundle covers of it. `length`: of a ray that goes from one to the other; 0: `end` is what it grows by a unit of way, as a cone does.
struct Widths {
    double start = 0, end = 0, length = 0;
    Vec3 start_normal{}, end_normal{}; // of the squares; none: across the ray
};

// From a place towards a light.
struct LightRay {
    Vec3 from, to;        // map units
    bool distant = false; // `to` is a unit direction, and light comes where that meets a sky face
    Widths widths{};      // `length` need not be set
};
struct Transmitted {
    Rgbd share;           // 0 where something blocks it; so it is, too, where a pane lets nothing through
    bool blocked = false; // only in the first case
};

// Where a ray crosses a pane: what is seen of it (times its own reflected light) and what comes through.
struct PaneHit {
    SceneHit hit;
    bool front = false;
    double opacity = 0; // from behind 0: there a pane takes light away and sends none
    Rgbd through{1, 1, 1};
};

// The ray-traced world: Embree over shared vertices, robust, one instruction set; hits re-evaluated in double.
class TraceScene {
public:
    TraceScene(const World& world, const Surfaces& surfaces);
    ~TraceScene();
    TraceScene(const TraceScene&) = delete;
    TraceScene& operator=(const TraceScene&) = delete;
    // First blocking face along the ray within (near, far); nothing: escaped.
    std::optional<SceneHit> closest(Vec3 origin, Vec3 unit_direction, double far = 1e30) const;
    // The same for a bundle of rays, faster where they start close together.
    void closest(std::span<const Vec3> origins, std::span<const Vec3> unit_directions,
                 std::span<std::optional<SceneHit>> hits) const;
    // Is anything that blocks light strictly between? Sky faces count as blockers here.
    bool occluded(Vec3 from, Vec3 to) const;
    void occluded(std::span<const Vec3> from, std::span<const Vec3> to, std::span<std::uint8_t> hidden) const; // of many together, faster where they lie close to each other
    // Does a ray reach a sky face (or, in a map that leaks, nothing at all)?
    bool reaches_sky(Vec3 origin, Vec3 unit_direction) const;
    // Faces that let a part of the light through are no blockers for all of these. Are there any?
    bool has_panes() const;
    // Those that a ray crosses before `far`, nearest first.
    void panes(Vec3 origin, Vec3 unit_direction, double far, const Widths& widths, std::vector<PaneHit>& out) const;
    // The share of light that arrives; of many rays together faster where they lie close to each other.
    Transmitted transmitted(const LightRay& ray) const;
    void transmitted(std::span<const LightRay> rays, std::vector<Transmitted>& out) const;
    // Does no light come through the face, whole or in part?
    bool stops(FaceId face) const;
    // How far in front of its surface a ray should start, map units.
    double push_off() const;
    // Rays that this thread has traced so far, through any scene: for measuring.
    static std::uint64_t traced();
    // "avx2", or "sse4.2" on a processor without it: part of what the bytes of a bake depend on.
    const std::string& instruction_set() const;

private:
    struct Data;
    std::unique_ptr<Data> data_;
};

// One contribution to the light arriving at a point: `weight` = radiance times solid angle (irradiance on a plane
// facing it), `direction` = unit vector towards where it comes from.
using Arrival = std::function<void(Vec3 direction, Rgbd weight)>;

class Looked; // memo.h

// What the rays of a point met. It depends on geometry; `several` and their terms, where light was looked for close by, on what is told by `Looked`,
// too: so light can be looked up in it again when it has changed.
struct FieldBundle {
    static constexpr std::uint32_t kSky = UINT32_MAX, kBlack = UINT32_MAX - 1, kSeveral = UINT32_MAX - 2;
    struct Term { // a share of what is reflected at a place
        static constexpr bool kRawBytes = true;
        std::uint32_t place = kBlack;
        Rgb share;
    };
    struct Several { // of a ray with several terms, or with light that was looked for on the way of its path close by
        static constexpr bool kRawBytes = true;
        Rgb sum;
        std::uint32_t end = 0; // of its terms
    };
    struct Shining { // what a ray saw of an emitter
        static constexpr bool kRawBytes = true;
        std::uint32_t ray = 0, emitter = 0;
        Rgb share;
    };
    std::vector<std::uint32_t> place; // per ray; kSeveral: the next of `several`
    std::vector<Several> several;
    std::vector<Term> terms;
    std::vector<Shining> shining;
    template <class A> void fields(A& a) { a(place, several, terms, shining); }
};
// Emitters that get rays of their own at a point, ascending, and what these bring.
struct FieldEmitters {
    struct Arriving {
        static constexpr bool kRawBytes = true;
        Vec3 direction;
        Rgbd weight;
    };
    std::vector<std::uint32_t> listed;
    std::vector<Arriving> arrivals;
    template <class A> void fields(A& a) { a(listed, arrivals); }
};

class LightField {
public:
    // `seen`: as of bake_light; has to live as long.
    LightField(const World& world, const Bsp& bsp, const PlaneTable& planes, const Surfaces& surfaces,
               const std::vector<Light>& lights, const Lighting& lighting, const Visibility* seen = nullptr);
    ~LightField();
    const TraceScene& scene() const;
    void each_light(Vec3 point, const std::function<void(std::uint32_t)>& visit) const; // entities that may shine there, ascending
    // Light arriving at `point` from the hemisphere around `normal` (unit), or from the whole sphere where `normal`
    // is zero, through the production path (explicit direct light + gather of patch radiosity).
    // The sum over calls of weight * kernel(direction) estimates the integral of L * kernel over solid angle.
    // `rays`: size of the gathered bundle (power of two). Deterministic in (point, seed).
    void arriving(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed, const Arrival& arrival) const;
    // Only direct light of entities (point, spot, sun).
    void arriving_direct(Vec3 point, Vec3 normal, std::uint64_t seed, const Arrival& arrival) const;
    // The rest, in steps, for who keeps what the rays met. `looked`: notes the parts of the field that it depends on.
    FieldBundle bundle(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed, Looked* looked = nullptr) const;
    std::vector<Rgbd> reflected(const FieldBundle& bundle) const; // radiance that its rays bring, emitters left out
    // Irradiance that they bring, in the mean of all directions where `normal` is zero; the next power of two, so that
    // what is decided by it stays as it is when light changes a little. 0: nothing shines.
    double level(const FieldBundle& bundle, std::span<const Rgbd> reflected, Vec3 normal, std::uint64_t seed) const;
    FieldEmitters emitters(const FieldBundle& bundle, double level, Vec3 point, Vec3 normal, std::uint64_t seed) const;
    // `of_rays` is called for each of the bundle.
    void arriving(const FieldBundle& bundle, std::vector<Rgbd> reflected, const FieldEmitters& emitters, Vec3 normal, std::uint64_t seed,
                  const Arrival& of_emitters, const Arrival& of_rays) const;
    // Hashes of the parts of the field: where those that a bundle looked at are what they were in a field of the same geometry with the same
    // faces that shine, the bundle is what it was.
    const std::vector<std::uint64_t>& part_states() const;
    std::size_t light_parts() const; // the first so many are of light itself; the last of them is of the sky, what shines and what materials reflect
    std::uint64_t shining_faces() const;  // a hash of which do; 0: none
    // Radiance leaving what a ray sees: emission + reflectance/pi * lightmap irradiance, or the sky. For probes.
    // What stands behind panes is seen through them. `width`: of the cone that the ray stands for, a unit of way.
    Rgb radiance(Vec3 origin, Vec3 unit_direction, SceneHit* hit = nullptr, double width = 0) const;
    void radiance(Vec3 origin, std::span<const Vec3> unit_directions, std::span<Rgb> out, double width) const; // of many, faster where they lie close to each other

    struct Data;
    const Data& data() const; // for the path tracer of this folder

private:
    Rgb leaving(Vec3 origin, Vec3 unit_direction, const std::optional<SceneHit>& hit, double width) const;
    std::unique_ptr<Data> data_;
};

// Path-traced truth by the same scene code: as `arriving`, unbiased, next-event estimation at every bounce.
void reference_arriving(const LightField& field, Vec3 point, Vec3 normal, std::uint32_t paths, std::uint64_t seed,
                        const Arrival& arrival);

} // namespace kiln
