// A ray caster through the level's own mesh. What a pixel shows is what a shader would compute from the same data:
//
//   radiance = albedo / pi * E(n) + emission + env_map * F(cos) * cubemap(reflected, parallax-corrected, roughness)
//
// with E by the level's directional encoding and n from the normal map.
#include "libs/core/check.h"
#include "libs/parallel/parallel.h"
#include "tools/render/colours.h"
#include "tools/render/parts.h"
#include "tools/render/render.h"
#include "tools/render/textures.h"
#include <cstring>
#include <embree3/rtcore.h>
#include <memory>
#include <numbers>
#include <pmmintrin.h>
#include <xmmintrin.h>

namespace kiln {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kMaxLayers = 16; // surfaces a ray may pass through: culled backs and panes of glass

// The level's triangles in Embree.
class Tracer {
public:
    Tracer(std::span<const float> positions, std::span<const std::uint32_t> triangles) {
        device_ = rtcNewDevice(nullptr);
        KILN_CHECK(device_);
        scene_ = rtcNewScene(device_);
        rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
        RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
        void* v = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, positions.size() / 3);
        void* t = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles.size() / 3);
        KILN_CHECK(v && t);
        std::memcpy(v, positions.data(), positions.size_bytes());
        std::memcpy(t, triangles.data(), triangles.size_bytes());
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(scene_, geometry);
        rtcReleaseGeometry(geometry);
        rtcCommitScene(scene_);
    }
    ~Tracer() { rtcReleaseScene(scene_), rtcReleaseDevice(device_); }
    Tracer(const Tracer&) = delete;
    Tracer& operator=(const Tracer&) = delete;

    bool closest(Vec3 origin, Vec3 direction, double from, std::uint32_t* triangle, double* distance) const {
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        RTCRayHit ray{};
        ray.ray.org_x = static_cast<float>(origin.x), ray.ray.org_y = static_cast<float>(origin.y);
        ray.ray.org_z = static_cast<float>(origin.z);
        ray.ray.dir_x = static_cast<float>(direction.x), ray.ray.dir_y = static_cast<float>(direction.y);
        ray.ray.dir_z = static_cast<float>(direction.z);
        ray.ray.tnear = static_cast<float>(from), ray.ray.tfar = 1e30f;
        ray.ray.mask = ~0u;
        ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene_, &context, &ray);
        if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
        *triangle = ray.hit.primID, *distance = ray.ray.tfar;
        return true;
    }

private:
    RTCDevice device_ = nullptr;
    RTCScene scene_ = nullptr;
};

struct Surface { // what a ray meets
    std::uint32_t face = 0, triangle = 0;
    Vec3 point, view; // view: towards the eye
    double footprint = 0; // map units across a pixel
};

class View {
public:
    View(const kiln_level* level, const CameraOptions& options, Context& context)
        : level_(level), options_(options), planes_(part(level, kiln_level_planes)), faces_(part(level, kiln_level_faces)),
          charts_(part(level, kiln_level_charts)), materials_(part(level, kiln_level_materials)),
          positions_(part(level, kiln_level_positions, 3)), triangles_(part(level, kiln_level_triangles, 3)),
          normals_(part(level, kiln_level_corner_normals, 9)), sky_(options.sky) {
        triangle_face_.resize(triangles_.size() / 3);
        for (std::uint32_t f = 0; f < faces_.size(); ++f)
            for (std::uint32_t t = 0; t < faces_[f].triangle_count; ++t)
                triangle_face_[std::size_t{faces_[f].first_triangle} + t] = f;
        if (options.own_sky)
            for (const kiln_light& light : part(level, kiln_level_lights))
                if (light.kind == 3) { // sky
                    sky_ = {light.intensity[0], light.intensity[1], light.intensity[2]};
                    break;
                }
        albedo_.resize(materials_.size()), normal_.resize(materials_.size());
        std::vector<bool> used(materials_.size());
        for (const kiln_face& f : faces_) used[f.material] = used[f.material] || (f.flags & KILN_FACE_DRAWN);
        for (std::size_t m = 0; m < materials_.size(); ++m) {
            if (!used[m]) continue;
            const kiln_material& material = materials_[m];
            albedo_[m] = load_texture(material.albedo_map, Transfer::srgb, options.texture_directories, context);
            if (options.normal_maps)
                normal_[m] = load_texture(material.normal_map, Transfer::linear, options.texture_directories, context);
        }
        if (options.show == Show::error || options.show == Show::validity) load_quality();
        tracer_ = std::make_unique<Tracer>(positions_, triangles_);
    }

    Rgb along(Vec3 origin, Vec3 direction, double pixel_angle) const {
        Rgb sum{};
        float through = 1;
        double from = 0;
        for (int layer = 0; layer < kMaxLayers && through > 0.005f; ++layer) {
            Surface hit;
            double distance = 0;
            if (!tracer_->closest(origin, direction, from, &hit.triangle, &distance)) break;
            from = distance * (1 + 1e-5) + 1e-3;
            hit.face = triangle_face_[hit.triangle];
            const kiln_face& face = faces_[hit.face];
            const Vec3 normal = face_normal(hit);
            const double facing = -dot(normal, direction);
            if (facing <= 0 && !(face.flags & KILN_FACE_TWO_SIDED)) continue; // backs are not drawn
            if (face.flags & KILN_FACE_SKY) return sum + background() * through;
            if (!(face.flags & KILN_FACE_DRAWN)) continue;
            hit.point = origin + direction * distance, hit.view = -direction;
            hit.footprint = distance * pixel_angle / std::sqrt(std::max(0.02, std::abs(facing)));
            float alpha = 1;
            const Rgb c = shade(hit, &alpha);
            sum += c * (through * alpha);
            through *= 1 - alpha;
        }
        return sum + background() * through;
    }

private:
    const kiln_level* level_;
    const CameraOptions& options_;
    std::span<const kiln_plane> planes_;
    std::span<const kiln_face> faces_;
    std::span<const kiln_chart> charts_;
    std::span<const kiln_material> materials_;
    std::span<const float> positions_;
    std::span<const std::uint32_t> triangles_;
    std::span<const float> normals_;
    std::vector<std::uint32_t> triangle_face_;
    std::vector<Texture> albedo_, normal_;
    struct Quality { std::uint32_t width = 0; std::vector<std::uint8_t> valid; std::vector<float> error; };
    std::vector<Quality> quality_; // per page
    std::unique_ptr<Tracer> tracer_;
    Rgb sky_;

    Rgb background() const {
        return options_.show == Show::shaded || options_.show == Show::irradiance || options_.show == Show::flat ? sky_
                                                                                                                  : Rgb{};
    }

    void load_quality() {
        kiln_info info{};
        kiln_level_info(level_, &info);
        quality_.resize(info.pages);
        for (std::uint32_t p = 0; p < info.pages; ++p) {
            kiln_page page{};
            if (kiln_level_page_info(level_, p, &page) != KILN_OK) continue;
            Quality& q = quality_[p];
            const std::size_t n = std::size_t{page.width} * page.height;
            q.width = page.width, q.valid.resize(n), q.error.resize(n);
            if (kiln_level_page_quality(level_, p, q.valid.data(), q.error.data()) != KILN_OK) q = {};
        }
    }

    Vec3 corner(std::uint32_t triangle, std::size_t c) const {
        const float* p = &positions_[std::size_t{3} * triangles_[std::size_t{3} * triangle + c]];
        return {p[0], p[1], p[2]};
    }
    Vec3 face_normal(const Surface& hit) const { // of the triangle, where the face has no plane
        const kiln_face& f = faces_[hit.face];
        if (f.flags & KILN_FACE_CURVED) {
            const Vec3 a = corner(hit.triangle, 0), n = cross(corner(hit.triangle, 1) - a, corner(hit.triangle, 2) - a);
            if (dot(n, n) > 0) return normalize(n);
        }
        return {f.normal[0], f.normal[1], f.normal[2]};
    }
    // Of the corners of the triangle; false: it has no area.
    bool weights(const Surface& hit, double w[3]) const {
        const Vec3 a = corner(hit.triangle, 0), b = corner(hit.triangle, 1), c = corner(hit.triangle, 2);
        const Vec3 n = cross(b - a, c - a);
        const double area = dot(n, n);
        if (!(area > 0)) return false;
        w[0] = dot(cross(b - hit.point, c - hit.point), n) / area;
        w[1] = dot(cross(c - hit.point, a - hit.point), n) / area;
        w[2] = dot(cross(a - hit.point, b - hit.point), n) / area;
        return true;
    }
    // Texture and luxel coordinates; on a curved face from the corners of the very triangle.
    void coordinates(const Surface& hit, double uv[2], double st[2]) const {
        const double at[3] = {hit.point.x, hit.point.y, hit.point.z};
        const kiln_curve_corner* c = kiln_level_curve_corners(level_, hit.face, nullptr);
        double w[3];
        if (c && weights(hit, w)) {
            c += std::size_t{3} * (hit.triangle - faces_[hit.face].first_triangle);
            for (std::size_t k = 0; k < 2; ++k) {
                uv[k] = w[0] * c[0].uv[k] + w[1] * c[1].uv[k] + w[2] * c[2].uv[k];
                st[k] = w[0] * c[0].luxel[k] + w[1] * c[1].luxel[k] + w[2] * c[2].luxel[k];
            }
            return;
        }
        kiln_level_texture_uv(level_, hit.face, at, uv);
        kiln_level_luxel_at(level_, hit.face, at, st);
    }
    Vec3 shading_normal(const Surface& hit) const {
        const Vec3 flat = face_normal(hit);
        double w[3];
        if (normals_.empty() || !weights(hit, w)) return flat;
        Vec3 sum{};
        for (std::size_t k = 0; k < 3; ++k) {
            const float* m = &normals_[std::size_t{9} * hit.triangle + 3 * k];
            sum += Vec3{m[0], m[1], m[2]} * std::max(0.0, w[k]);
        }
        return length(sum) > 1e-6 ? normalize(sum) : flat;
    }

    Rgb shade(const Surface& hit, float* alpha) const {
        const kiln_face& face = faces_[hit.face];
        const kiln_material& material = materials_[face.material];
        const double at[3] = {hit.point.x, hit.point.y, hit.point.z};
        switch (options_.show) {
        case Show::faces: return lit_name(hit, hit.face);
        case Show::probes: return face.probe == KILN_NO_INDEX ? Rgb{0.1f, 0.1f, 0.1f} : lit_name(hit, face.probe);
        case Show::clusters: return lit_name(hit, cluster_of(hit));
        case Show::luxels:
        case Show::error:
        case Show::validity: return luxel_view(hit);
        default: break;
        }

        double uv[2] = {}, st[2] = {};
        coordinates(hit, uv, st);
        const auto repeats = [&](const double* axis, double scale, std::uint32_t size) { // per map unit
            const double along = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
            return along / std::max(1e-6, std::abs(scale)) / std::max(1u, size) * hit.footprint;
        };
        const double fu = repeats(face.u_axis, face.u_scale, material.width);
        const double fv = repeats(face.v_axis, face.v_scale, material.height);

        Rgb albedo{material.reflectance[0], material.reflectance[1], material.reflectance[2]};
        *alpha = std::clamp(material.alpha, 0.0f, 1.0f);
        if (const Texture& texture = albedo_[face.material]; !texture.empty()) {
            const auto texel = texture.at(uv[0], uv[1], fu, fv);
            albedo = {texel[0], texel[1], texel[2]};
            *alpha *= texel[3];
        }
        if (options_.show == Show::albedo) return albedo;

        // Red runs with the texture's u, green with its v (down in the image), as Source has it.
        Frame frame;
        float t[3], b[3], n[3];
        const Vec3 smooth = shading_normal(hit);
        const float shading[3] = {static_cast<float>(smooth.x), static_cast<float>(smooth.y), static_cast<float>(smooth.z)};
        const bool needs_tangents = !normal_[face.material].empty() && (face.flags & KILN_FACE_CURVED);
        if (needs_tangents) kiln_level_tangent_frame_at(level_, hit.face, at, shading, t, b, n);
        else kiln_level_tangent_frame(level_, hit.face, shading, t, b, n);
        frame.t = {t[0], t[1], t[2]}, frame.b = {b[0], b[1], b[2]}, frame.n = {n[0], n[1], n[2]};
        Vec3 local{0, 0, 1};
        if (const Texture& texture = normal_[face.material]; !texture.empty() && options_.show != Show::flat) {
            const auto texel = texture.at(uv[0], uv[1], fu, fv);
            const Vec3 m{2.0 * texel[0] - 1, 2.0 * texel[1] - 1, 2.0 * texel[2] - 1};
            const Vec3 u{face.u_axis[0], face.u_axis[1], face.u_axis[2]}, v{face.v_axis[0], face.v_axis[1], face.v_axis[2]};
            local = {m.x * (dot(frame.t, u) * face.u_scale < 0 ? -1 : 1), m.y * (dot(frame.b, v) * face.v_scale < 0 ? -1 : 1),
                     std::max(0.05, m.z)};
            local = normalize(local);
        }
        Vec3 normal = frame.world(local);
        if (dot(normal, hit.view) < 0 && (face.flags & KILN_FACE_TWO_SIDED)) normal = -normal;
        if (options_.show == Show::normals) {
            const Vec3 shown = normal * 0.5 + Vec3{0.5, 0.5, 0.5};
            return Rgb(shown);
        }

        // A face without a lightmap (liquids, unlit shaders) shows as under an irradiance of 1.
        float e[3] = {1, 1, 1};
        const float ln[3] = {static_cast<float>(local.x), static_cast<float>(local.y), static_cast<float>(local.z)};
        if (face.chart != KILN_NO_INDEX) {
            if (options_.show == Show::flat)
                kiln_level_eval_flat_luxel(level_, face.chart, st[0], st[1], e);
            else
                kiln_level_eval_rnm_luxel(level_, face.chart, st[0], st[1], ln, e);
        }
        const Rgb irradiance{e[0], e[1], e[2]};
        const auto per_pi = static_cast<float>(1 / kPi);
        if (options_.show == Show::irradiance || options_.show == Show::flat) return irradiance * per_pi;
        const Rgb reflected = reflection(hit, material, face, normal);
        if (options_.show == Show::reflection) return reflected;
        return albedo * irradiance * per_pi + Rgb{material.emission[0], material.emission[1], material.emission[2]} +
               reflected;
    }

    Rgb reflection(const Surface& hit, const kiln_material& material, const kiln_face& face, Vec3 normal) const {
        if (!(material.env_map > 0)) return {};
        const double at[3] = {hit.point.x, hit.point.y, hit.point.z};
        std::uint32_t probe = face.probe;
        if (probe == KILN_NO_INDEX) probe = kiln_level_nearest_cubemap(level_, at);
        if (probe == KILN_NO_INDEX) return {};
        const double c = std::clamp(dot(normal, hit.view), 0.0, 1.0);
        const Vec3 r = normal * (2 * dot(normal, hit.view)) - hit.view;
        const double f0 = options_.fresnel_at_normal, fresnel = f0 + (1 - f0) * std::pow(1 - c, 5);
        const float direction[3] = {static_cast<float>(r.x), static_cast<float>(r.y), static_cast<float>(r.z)};
        float corrected[3], radiance[3];
        if (kiln_level_parallax_direction(level_, probe, at, direction, corrected) != KILN_OK) return {};
        if (kiln_level_sample_cubemap(level_, probe, corrected, material.roughness, radiance) != KILN_OK) return {};
        return Rgb{radiance[0], radiance[1], radiance[2]} * static_cast<float>(material.env_map * fresnel);
    }

    Rgb lit_name(const Surface& hit, std::uint64_t name) const { // with a little shape
        const Vec3 n = face_normal(hit);
        return name_colour(name) * static_cast<float>(0.4 + 0.6 * std::abs(dot(n, hit.view)));
    }
    std::uint64_t cluster_of(const Surface& hit) const {
        const Vec3 p = hit.point + face_normal(hit) * 0.25;
        const double at[3] = {p.x, p.y, p.z};
        const std::uint32_t leaf = kiln_level_find_leaf(level_, at);
        const auto leaves = part(level_, kiln_level_leaves);
        return leaf < leaves.size() ? static_cast<std::uint64_t>(leaves[leaf].cluster + 1) : 0;
    }
    Rgb luxel_view(const Surface& hit) const {
        const kiln_face& face = faces_[hit.face];
        if (face.chart == KILN_NO_INDEX) return {0.05f, 0.05f, 0.05f};
        const kiln_chart& c = charts_[face.chart];
        double uv[2] = {}, st[2] = {};
        coordinates(hit, uv, st);
        const auto texel = [&](double at, std::uint32_t size) {
            return static_cast<std::size_t>(std::clamp(std::floor(at), 0.0, static_cast<double>(size - 1)));
        };
        const std::size_t x = texel(st[0], c.width), y = texel(st[1], c.height);
        if (options_.show == Show::luxels) return luxel_colour(texel_size(c)) * ((x + y) & 1 ? 1.0f : 0.6f);
        if (quality_[c.page].valid.empty()) return {0.2f, 0.2f, 0.2f};
        const Quality& q = quality_[c.page];
        const std::size_t i = (c.page_y + y) * q.width + c.page_x + x;
        return options_.show == Show::error ? error_colour(q.error[i]) : validity_colour(q.valid[i]);
    }
};

} // namespace

Result<Image> render_camera(const kiln_level* level, const Camera& camera, const CameraOptions& options,
                            Context& context) {
    if (options.width < 1 || options.height < 1 || options.width > kMaxImageEdge || options.height > kMaxImageEdge)
        return fault(Exit::usage, "bad-picture-size", "a picture is 1 to 32768 pixels wide and high");
    kiln_info info{};
    kiln_level_info(level, &info);
    const struct { const char* name; bool there; } needs[] = {
        {"face table", info.faces == 0 || kiln_level_faces(level, nullptr)},
        {"material table", info.materials == 0 || kiln_level_materials(level, nullptr)},
        {"mesh", info.triangles == 0 || kiln_level_triangles(level, nullptr)},
        {"normals", info.triangles == 0 || kiln_level_corner_normals(level, nullptr)},
        {"chart table", info.charts == 0 || kiln_level_charts(level, nullptr)},
    };
    for (const auto& need : needs)
        if (!need.there) return damaged(need.name);
    for (std::uint32_t p = 0; p < info.pages; ++p) {
        kiln_page page{};
        if (const kiln_status status = kiln_level_page(level, p, &page); status != KILN_OK)
            return damaged("lightmap", status);
    }
    for (std::uint32_t p = 0; p < info.probes; ++p)
        if (!kiln_level_probe_texels(level, p, nullptr, nullptr)) return damaged("cubemaps");

    const View view(level, options, context);
    const double yaw = camera.yaw_deg * kPi / 180, pitch = camera.pitch_deg * kPi / 180;
    const Vec3 forward{std::cos(pitch) * std::cos(yaw), std::cos(pitch) * std::sin(yaw), -std::sin(pitch)};
    const Vec3 right{std::sin(yaw), -std::cos(yaw), 0}, up = cross(right, forward);
    const double half = std::tan(std::clamp(camera.fov_deg, 1.0, 170.0) * kPi / 360);
    const double pixel = 2 * half / options.width;
    const int grid = std::clamp(static_cast<int>(std::lround(std::sqrt(static_cast<double>(options.samples)))), 1, 8);

    Image image(options.width, options.height, 3);
    parallel_for(context, "render", static_cast<std::size_t>(options.height), [&](std::size_t row) {
        _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
        _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
        const int y = static_cast<int>(row);
        for (int x = 0; x < options.width; ++x) {
            Rgb sum{};
            for (int s = 0; s < grid * grid; ++s) {
                // Rows of samples are shifted against each other, so that no two share a column.
                const double dx = (s % grid + (s / grid + 0.5) / grid) / grid, dy = (s / grid + (s % grid + 0.5) / grid) / grid;
                const Vec3 direction = normalize(forward + right * ((x + dx) * pixel - half) -
                                                 up * ((y + dy - options.height / 2.0) * pixel));
                sum += view.along(camera.eye, direction, pixel / grid);
            }
            for (int c = 0; c < 3; ++c)
                image.at(x, y, c) = sum[static_cast<std::size_t>(c)] / static_cast<float>(grid * grid);
        }
    });
    return image;
}

} // namespace kiln
