// The ray-traced world. Embree decides which triangle a ray meets; where it meets it is computed again here, in
// double, from the plane of the face, so that nothing downstream depends on the last bits of a single-precision
// hit.
#include "compiler/light/transmission.h"
#include "libs/core/check.h"
#include <embree3/rtcore.h>
#include <limits>

namespace kiln {

namespace {
thread_local std::uint64_t rays_traced = 0;
}

// Origins stand this far in front of their surface. Large against the rounding of the local frame (2^-24 of its
// half extent), small against any wall.
constexpr double kPushOffShare = 0x1p-21; // of the world's largest extent
constexpr double kPushOffLeast = 0x1p-8;  // map units
// Robust as it is, the tracer lets 2 in 100,000 of the rays slip through that are aimed at the very corner of several
// triangles (none of those aimed at edges). A ray that met nothing is asked once more, so far aside of its direction.
constexpr double kAside = 0x1p-18;
constexpr double kShortOfEnd = 1 - 0x1p-20; // what a ray ends on does not block it

struct TraceScene::Data {
    Vec3 center; // of the local frame, map units
    double push = kPushOffLeast;
    std::string isa;
    std::vector<float> vertices; // local frame, padded as Embree asks
    std::vector<std::uint32_t> indices;
    struct Primitive {
        std::uint32_t triangle = 0; // of surfaces
        FaceId face;
    };
    std::vector<Primitive> primitives;
    struct Plane { // of a face, what a hit asks for: faces themselves lie too far apart in memory
        Vec3 normal;
        double distance = 0;
        bool two_sided = false, sky = false;
    };
    std::vector<Plane> planes;       // per face
    std::vector<std::uint8_t> stops; // per face
    RTCDevice device = nullptr;
    RTCScene scene = nullptr;
    std::unique_ptr<Panes> panes; // none: there are none

    Data() = default;
    Data(const Data&) = delete;
    Data& operator=(const Data&) = delete;
    ~Data() {
        panes.reset();
        if (scene) rtcReleaseScene(scene);
        if (device) rtcReleaseDevice(device);
    }
    template <class Ray> void set_ray(Ray& ray, Vec3 origin, Vec3 direction, double far) const {
        const Vec3 o = origin - center;
        ray.org_x = static_cast<float>(o.x), ray.org_y = static_cast<float>(o.y),
        ray.org_z = static_cast<float>(o.z);
        ray.dir_x = static_cast<float>(direction.x), ray.dir_y = static_cast<float>(direction.y);
        ray.dir_z = static_cast<float>(direction.z);
        ray.tnear = 0;
        ray.tfar = far < 1e30 ? static_cast<float>(far) : std::numeric_limits<float>::infinity();
        ray.time = 0, ray.mask = UINT32_MAX, ray.id = 0, ray.flags = 0;
    }
    void set_ray(RTCRay8& packet, std::size_t i, Vec3 origin, Vec3 direction, double far) const {
        RTCRay ray;
        set_ray(ray, origin, direction, far);
        packet.org_x[i] = ray.org_x, packet.org_y[i] = ray.org_y, packet.org_z[i] = ray.org_z;
        packet.dir_x[i] = ray.dir_x, packet.dir_y[i] = ray.dir_y, packet.dir_z[i] = ray.dir_z;
        packet.tnear[i] = ray.tnear, packet.tfar[i] = ray.tfar;
        packet.time[i] = ray.time, packet.mask[i] = ray.mask, packet.id[i] = ray.id, packet.flags[i] = ray.flags;
    }
    std::optional<SceneHit> again(Vec3 origin, Vec3 direction) const {
        const Vec3 least = std::abs(direction.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
        RTCRayHit ray;
        set_ray(ray.ray, origin, direction + cross(direction, least) * kAside, 1e30);
        ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        ++rays_traced;
        rtcIntersect1(scene, &context, &ray);
        if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
        std::optional<SceneHit> hit;
        resolve(origin, direction, ray.hit.primID, ray.ray.tfar, hit.emplace());
        return hit;
    }
    // In its place: a hit that is put together elsewhere and copied waits for its own writes.
    void resolve(Vec3 origin, Vec3 direction, std::uint32_t primitive, float t, SceneHit& hit) const {
        hit.triangle = primitives[primitive].triangle;
        hit.face = primitives[primitive].face;
        const Plane& face = planes[hit.face.at()];
        const double cosine = dot(face.normal, direction);
        const double exact = (face.distance - dot(face.normal, origin)) / cosine;
        // Nearly parallel to the face the quotient is worthless, and Embree's own distance is the better one.
        hit.distance = std::abs(cosine) > 1e-4 ? std::max(0.0, exact) : static_cast<double>(t);
        hit.position = origin + direction * hit.distance;
        hit.back = cosine > 0 && !face.two_sided;
        hit.sky = face.sky;
    }
    // `way(i)`: from where to where. Packets and single rays give the same bits.
    template <class Way> void occluded(std::size_t count, const Way& way, std::span<std::uint8_t> hidden) const {
        constexpr std::size_t kWidth = 8;
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        for (std::size_t first = 0; first < count; first += kWidth) {
            const std::size_t part = std::min(kWidth, count - first);
            alignas(32) RTCRay8 packet;
            alignas(32) int valid[kWidth];
            for (std::size_t i = 0; i < kWidth; ++i) {
                const auto [from, to] = way(first + std::min(i, part - 1));
                const Vec3 d = to - from;
                const double distance = length(d);
                valid[i] = i < part && distance > 0 ? -1 : 0;
                rays_traced += valid[i] != 0;
                set_ray(packet, i, from, d / distance, distance * kShortOfEnd);
            }
            rtcOccluded8(valid, scene, &context, &packet);
            for (std::size_t i = 0; i < part; ++i) hidden[first + i] = valid[i] && packet.tfar[i] < 0;
        }
    }
    // What panes leave of a ray that nothing blocks; `far`: where one to a distant light ends.
    Rgbd through(const LightRay& ray, double far) const {
        Rgbd share{1, 1, 1};
        if (!panes) return share;
        Vec3 way = ray.to;
        Widths widths = ray.widths;
        if (!ray.distant) {
            way = ray.to - ray.from, far = widths.length = length(way);
            if (!(far > 0)) return share;
            way = way / far;
        }
        thread_local std::vector<PaneHit> crossed;
        panes->along(ray.from, way, far, widths, crossed);
        for (const PaneHit& pane : crossed) share = share * pane.through;
        return share;
    }
};

TraceScene::TraceScene(const World& world, const Surfaces& surfaces) : data_(std::make_unique<Data>()) {
    Data& d = *data_;
    Box3 box;
    for (const Vec3& p : surfaces.positions) box.add(p);
    if (!box.empty()) {
        const Vec3 c = box.center();
        d.center = {std::round(c.x / 64) * 64, std::round(c.y / 64) * 64, std::round(c.z / 64) * 64};
        d.push = std::max(kPushOffLeast, max_component(box.size()) * kPushOffShare);
    }
    d.vertices.reserve(surfaces.positions.size() * 3 + 4);
    for (const Vec3& p : surfaces.positions) {
        const Vec3 q = p - d.center;
        d.vertices.insert(d.vertices.end(),
                          {static_cast<float>(q.x), static_cast<float>(q.y), static_cast<float>(q.z)});
    }
    d.vertices.insert(d.vertices.end(), 4, 0.0f);
    auto panes = std::make_unique<Panes>(world, surfaces);
    for (std::uint32_t f = 0; f < surfaces.faces.size(); ++f) {
        const Panes::Kind kind = panes->kind({f});
        const bool lets_through = kind == Panes::Kind::pane || kind == Panes::Kind::clear;
        const Face& face = surfaces.faces[f];
        d.planes.push_back({face.normal, face.distance, face.two_sided, face.sky});
        d.stops.push_back(!lets_through && (face.blocks_light || face.sky || kind == Panes::Kind::blocks));
    }
    for (std::size_t t = 0; t < surfaces.triangles.size(); ++t) {
        if (!d.stops[surfaces.triangle_face[t].at()]) continue;
        const auto& corner = surfaces.triangles[t];
        d.indices.insert(d.indices.end(), corner.begin(), corner.end());
        d.primitives.push_back({static_cast<std::uint32_t>(t), surfaces.triangle_face[t]});
    }
    // One instruction set for everybody: hits differ in their last bits between the classes {AVX2, AVX-512} and
    // {SSE4.2, AVX}. Only a processor without AVX2 gets the other one.
    __builtin_cpu_init();
    d.isa = __builtin_cpu_supports("avx2") ? "avx2" : "sse4.2";
    d.device = rtcNewDevice(("isa=" + d.isa).c_str());
    KILN_CHECK(d.device != nullptr);
    d.scene = rtcNewScene(d.device);
    rtcSetSceneFlags(d.scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(d.scene, RTC_BUILD_QUALITY_HIGH);
    if (!d.primitives.empty()) {
        RTCGeometry geometry = rtcNewGeometry(d.device, RTC_GEOMETRY_TYPE_TRIANGLE);
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, d.vertices.data(), 0,
                                   3 * sizeof(float), surfaces.positions.size());
        rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, d.indices.data(), 0,
                                   3 * sizeof(std::uint32_t), d.primitives.size());
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(d.scene, geometry);
        rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(d.scene);
    if (!panes->empty()) {
        panes->build(d.device, d.vertices, surfaces.positions.size(), d.center);
        d.panes = std::move(panes);
    }
    KILN_CHECK_OP(rtcGetDeviceError(d.device), ==, RTC_ERROR_NONE);
}

TraceScene::~TraceScene() = default;

double TraceScene::push_off() const {
    return data_->push;
}
const std::string& TraceScene::instruction_set() const {
    return data_->isa;
}

std::uint64_t TraceScene::traced() { return rays_traced; }

std::optional<SceneHit> TraceScene::closest(Vec3 origin, Vec3 unit_direction, double far) const {
    const Data& d = *data_;
    RTCRayHit ray;
    d.set_ray(ray.ray, origin, unit_direction, far);
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    ++rays_traced;
    rtcIntersect1(d.scene, &context, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return far < 1e30 ? std::nullopt : d.again(origin, unit_direction);
    std::optional<SceneHit> hit;
    d.resolve(origin, unit_direction, ray.hit.primID, ray.ray.tfar, hit.emplace());
    return hit;
}

void TraceScene::closest(std::span<const Vec3> origins, std::span<const Vec3> unit_directions,
                         std::span<std::optional<SceneHit>> hits) const {
    // Packets and single rays give the same bits on one instruction set, so the width is a matter of speed alone.
    rays_traced += origins.size();
    const Data& d = *data_;
    constexpr std::size_t kWidth = 8;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    for (std::size_t first = 0; first < origins.size(); first += kWidth) {
        const std::size_t count = std::min(kWidth, origins.size() - first);
        alignas(32) RTCRayHit8 packet;
        alignas(32) int valid[kWidth];
        for (std::size_t i = 0; i < kWidth; ++i) {
            const std::size_t k = first + std::min(i, count - 1);
            valid[i] = i < count ? -1 : 0;
            d.set_ray(packet.ray, i, origins[k], unit_directions[k], 1e30);
            packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
            packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        }
        rtcIntersect8(valid, d.scene, &context, &packet);
        for (std::size_t i = 0; i < count; ++i) {
            if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID)
                hits[first + i] = d.again(origins[first + i], unit_directions[first + i]);
            else
                d.resolve(origins[first + i], unit_directions[first + i], packet.hit.primID[i], packet.ray.tfar[i], hits[first + i].emplace());
        }
    }
}

bool TraceScene::occluded(Vec3 from, Vec3 to) const {
    const Data& d = *data_;
    const Vec3 way = to - from;
    const double distance = length(way);
    if (!(distance > 0)) return false;
    RTCRay ray;
    d.set_ray(ray, from, way / distance, distance * kShortOfEnd);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    ++rays_traced;
    rtcOccluded1(d.scene, &context, &ray);
    return ray.tfar < 0;
}

void TraceScene::occluded(std::span<const Vec3> from, std::span<const Vec3> to, std::span<std::uint8_t> hidden) const {
    data_->occluded(from.size(), [&](std::size_t i) { return std::pair(from[i], to[i]); }, hidden);
}

bool TraceScene::has_panes() const {
    return data_->panes != nullptr;
}

void TraceScene::panes(Vec3 origin, Vec3 unit_direction, double far, const Widths& widths, std::vector<PaneHit>& out) const {
    out.clear();
    if (data_->panes) data_->panes->along(origin, unit_direction, far, widths, out);
}

Transmitted TraceScene::transmitted(const LightRay& ray) const {
    if (!ray.distant) return occluded(ray.from, ray.to) ? Transmitted{{}, true} : Transmitted{data_->through(ray, 1e30)};
    const std::optional<SceneHit> hit = closest(ray.from, ray.to);
    return hit && (!hit->sky || hit->back) ? Transmitted{{}, true} : Transmitted{data_->through(ray, hit ? hit->distance : 1e30)};
}

void TraceScene::transmitted(std::span<const LightRay> rays, std::vector<Transmitted>& out) const {
    thread_local std::vector<std::uint8_t> hidden;
    out.resize(rays.size()), hidden.resize(rays.size());
    if (std::ranges::any_of(rays, &LightRay::distant)) { // suns are few
        std::ranges::transform(rays, out.begin(), [&](const LightRay& ray) { return transmitted(ray); });
        return;
    }
    data_->occluded(rays.size(), [&](std::size_t i) { return std::pair(rays[i].from, rays[i].to); }, hidden);
    for (std::size_t i = 0; i < rays.size(); ++i) out[i] = {hidden[i] ? Rgbd{} : data_->through(rays[i], 1e30), hidden[i] != 0};
}

bool TraceScene::stops(FaceId face) const {
    return data_->stops[face.at()];
}

bool TraceScene::reaches_sky(Vec3 origin, Vec3 unit_direction) const {
    const std::optional<SceneHit> hit = closest(origin, unit_direction);
    return !hit || (hit->sky && !hit->back);
}

} // namespace kiln
