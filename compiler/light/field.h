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
    // Does a ray reach a sky face (or, in a map that leaks, nothing at all)?
    bool reaches_sky(Vec3 origin, Vec3 unit_direction) const;
    // Faces that let a part of the light through are no blockers for all of these. Are there any?
    bool has_panes() const;
    // Those that a ray crosses before `far`, nearest first.
    void panes(Vec3 origin, Vec3 unit_direction, double far, const Widths& widths, std::vector<PaneHit>& out) const;
    // The share of light that comes from one point to another: 0 where something blocks it (then `blocked` is set; a pane that lets nothing through
    // just there does not). `widths.length` need not be set.
    Rgbd transmitted(Vec3 from, Vec3 to, Widths widths = {}, bool* blocked = nullptr) const;
    // The same of light from a sky face (`widths`: a cone).
    Rgbd transmitted_from_sky(Vec3 origin, Vec3 unit_direction, const Widths& widths = {}, bool* blocked = nullptr) const;
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

class LightField {
public:
    LightField(const World& world, const Bsp& bsp, const PlaneTable& planes, const Surfaces& surfaces,
               const std::vector<Light>& lights, const Lighting& lighting);
    ~LightField();
    const TraceScene& scene() const;
    // Light arriving at `point` from the hemisphere around `normal` (unit), or from the whole sphere where `normal`
    // is zero, through the production path (explicit direct light + gather of patch radiosity).
    // The sum over calls of weight * kernel(direction) estimates the integral of L * kernel over solid angle.
    // `rays`: size of the gathered bundle (power of two). Deterministic in (point, seed).
    void arriving(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed, const Arrival& arrival) const;
    // Only direct light of entities (point, spot, sun), or only the rest.
    void arriving_direct(Vec3 point, Vec3 normal, std::uint64_t seed, const Arrival& arrival) const;
    // `looked`: notes which parts of the field it depends on. `bundle`: the ways of its rays; what they bring comes last and in this order,
    // each at most once.
    void arriving_rest(Vec3 point, Vec3 normal, std::uint32_t rays, std::uint64_t seed,
                       const Arrival& arrival, Looked* looked = nullptr, std::vector<Vec3>* bundle = nullptr) const;
    // Hashes of the parts of the field, and of what all light depends on (sky, emitters). Where both are what they were in a field
    // of the same geometry, arriving_rest gives what it gave.
    std::vector<std::uint64_t> part_states() const;
    std::uint64_t state() const;
    // Radiance leaving what a ray sees: emission + reflectance/pi * lightmap irradiance, or the sky. For probes.
    // What stands behind panes is seen through them. `width`: of the cone that the ray stands for, a unit of way.
    Rgb radiance(Vec3 origin, Vec3 unit_direction, SceneHit* hit = nullptr, double width = 0) const;

    struct Data;
    const Data& data() const; // for the path tracer of this folder

private:
    std::unique_ptr<Data> data_;
};

// Path-traced truth by the same scene code: as `arriving`, unbiased, next-event estimation at every bounce.
void reference_arriving(const LightField& field, Vec3 point, Vec3 normal, std::uint32_t paths, std::uint64_t seed,
                        const Arrival& arrival);

} // namespace kiln
