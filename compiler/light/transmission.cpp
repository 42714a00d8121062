// Light through panes.
#include "compiler/light/transmission.h"
#include "compiler/light/bake.h"
#include "compiler/world/panes.h"
#include "libs/core/check.h"
#include <limits>
#include <map>

namespace kiln {
namespace {

constexpr double kLeastCosine = 0.02; // a bundle that grazes a pane is not stretched without bound
constexpr double kPointTexels = 1e-3; // rectangles smaller than this are points: their sums would be rounding

bool liquid(Contents c) { return c == Contents::water || c == Contents::slime || c == Contents::lava; }

} // namespace

TexelSums::TexelSums(int width, int height, const Bytes& texels) : width_(width), height_(height) {
    const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
    sum_.resize((w + 1) * (h + 1));
    for (std::size_t y = 0; y < h; ++y) {
        std::uint32_t row = 0;
        for (std::size_t x = 0; x < w; ++x) {
            row += texels[y * w + x];
            sum_[(y + 1) * (w + 1) + x + 1] = sum_[y * (w + 1) + x + 1] + row;
        }
    }
}

double TexelSums::below(double x, double y) const {
    const auto i = std::min(static_cast<std::size_t>(x), static_cast<std::size_t>(width_ - 1)), j = std::min(static_cast<std::size_t>(y), static_cast<std::size_t>(height_ - 1));
    const double u = x - static_cast<double>(i), v = y - static_cast<double>(j);
    const std::size_t row = static_cast<std::size_t>(width_) + 1;
    const auto at = [&](std::size_t a, std::size_t b) { return static_cast<double>(sum_[b * row + a]); };
    return (at(i, j) * (1 - u) + at(i + 1, j) * u) * (1 - v) + (at(i, j + 1) * (1 - u) + at(i + 1, j + 1) * u) * v;
}

double TexelSums::across(double x, double y) const {
    const double kx = std::floor(x / width_), ky = std::floor(y / height_);
    const double rx = std::clamp(x - kx * width_, 0.0, 1.0 * width_), ry = std::clamp(y - ky * height_, 0.0, 1.0 * height_);
    return kx * ky * sum_.back() + kx * below(width_, ry) + ky * below(rx, height_) + below(rx, ry);
}

double TexelSums::mean(Vec2 middle, Vec2 size) const {
    constexpr double kMany = 64; // repeats: one more or less makes no difference
    const Vec2 at{(middle.x - std::floor(middle.x)) * width_, (middle.y - std::floor(middle.y)) * height_};
    double w = size.x * width_, h = size.y * height_;
    if (!(w < kMany * width_)) w = width_;
    if (!(h < kMany * height_)) h = height_;
    if (!(w > kPointTexels) && !(h > kPointTexels)) {
        const auto i = std::min(static_cast<std::size_t>(at.x), static_cast<std::size_t>(width_ - 1)), j = std::min(static_cast<std::size_t>(at.y), static_cast<std::size_t>(height_ - 1));
        const std::size_t row = static_cast<std::size_t>(width_) + 1;
        return (sum_[(j + 1) * row + i + 1] - sum_[(j + 1) * row + i] - sum_[j * row + i + 1] + sum_[j * row + i]) / 255.0;
    }
    w = std::max(w, kPointTexels), h = std::max(h, kPointTexels);
    const double x0 = at.x - w / 2, x1 = at.x + w / 2, y0 = at.y - h / 2, y1 = at.y + h / 2;
    return std::clamp((across(x1, y1) - across(x0, y1) - across(x1, y0) + across(x0, y0)) / (w * h * 255), 0.0, 1.0);
}

PaneSkin::PaneSkin(const Material& m, double opacity) : alpha_(std::clamp(m.alpha * opacity, 0.0, 1.0)), mapped_(!m.opacity_map.empty()) {
    const OpacityMap& map = m.opacity_map;
    if (m.tint) {
        tint_ = static_cast<Rgbd>(*m.tint);
    } else if (m.flags & kTranslucent) { // the hue alone: how much comes through is for alpha to say
        const Rgbd rho = static_cast<Rgbd>(m.reflectance);
        const double most = max_component(rho);
        if (most > 0) tint_ = rho / most;
        coloured_ = !map.tint.empty();
    }
    const auto all = [&](std::uint8_t value) { return !mapped_ || std::ranges::all_of(map.opacity, [&](std::uint8_t t) { return t == value; }); };
    opaque_ = opaque_pane(m, opacity);
    clear_ = alpha_ <= 0 || (mapped_ && all(0) && !coloured_ && tint_ == Rgbd{1, 1, 1});
    if (!mapped_ || opaque_ || clear_) return;
    opacity_ = TexelSums(map.width, map.height, map.opacity);
    if (!coloured_) return;
    Bytes through(map.opacity.size());
    for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t t = 0; t < through.size(); ++t) through[t] = static_cast<std::uint8_t>(std::lround((1 - alpha_ * map.opacity[t] / 255.0) * map.tint[3 * t + c]));
        through_[c] = TexelSums(map.width, map.height, through);
    }
}

void PaneSkin::at(Vec2 uv, Vec2 size, double* opacity, Rgbd* through) const {
    *opacity = mapped_ ? alpha_ * opacity_.mean(uv, size) : alpha_;
    if (coloured_)
        for (std::size_t c = 0; c < 3; ++c) (*through)[c] = std::min(through_[c].mean(uv, size), 1 - *opacity);
    else
        *through = tint_ * (1 - *opacity);
}

Panes::Panes(const World& world, const Surfaces& surfaces) : world_(world), surfaces_(surfaces), face_skin_(surfaces.faces.size()) {
    std::vector<std::pair<std::uint32_t, double>> skins;
    for (std::size_t f = 0; f < surfaces.faces.size(); ++f) {
        face_skin_[f] = of_face(surfaces.faces[f], skins);
        if (face_skin_[f].kind != Kind::pane) continue;
        const Face& face = surfaces.faces[f];
        for (std::uint32_t t = face.first_triangle; t < face.first_triangle + face.triangle_count; ++t) {
            triangles_.push_back(place(t));
            const auto& corner = surfaces.triangles[t];
            indices_.insert(indices_.end(), corner.begin(), corner.end());
        }
    }
}

Panes::~Panes() {
    if (scene_) rtcReleaseScene(scene_);
}

Panes::OfFace Panes::of_face(const Face& face, std::vector<std::pair<std::uint32_t, double>>& skins) {
    if (!face.drawn || face.sky || !face.material.valid()) return {};
    const Material& m = world_.materials[face.material.at()];
    const WorldBrush* brush = nullptr;
    std::optional<double> opacity;
    if (face.curved() && surfaces_.curves[face.curve].kind == Curve::patch) {
        opacity = pane_opacity(world_, m, world_.patches[surfaces_.curves[face.curve].source]);
    } else if (face.side.valid() && !world_.brushes.empty()) {
        brush = &world_.brushes[world_.brush_of(face.side).at()];
        opacity = pane_opacity(world_, m, *brush);
    } else {
        opacity = pane_opacity(world_, m, {}, false, false);
    }
    if (!opacity) return {};
    OfFace out;
    const std::pair wanted{face.material.value, *opacity};
    const auto known = std::ranges::find(skins, wanted);
    out.skin = static_cast<std::uint32_t>(known - skins.begin());
    if (known == skins.end()) skins.push_back(wanted), skins_.emplace_back(m, *opacity);
    const PaneSkin& skin = skins_[out.skin];
    out.kind = skin.opaque() ? Kind::blocks : skin.clear() ? Kind::clear : Kind::pane;
    if (out.kind != Kind::pane || face.curved() || !brush || liquid(brush->contents)) return out;
    // A brush counts once, where a ray enters it. The side opposite is one that it can have entered by if it is a pane as well.
    const auto normal = [&](std::uint32_t s) {
        std::array<Vec3, 3> p;
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t k = 0; k < 3; ++k) p[i][k] = world_.sides[s].points[i][k].to_double();
        return normalize(cross(p[1] - p[0], p[2] - p[0]));
    };
    const Vec3 own = normal(face.side.value);
    double least = 2;
    std::uint32_t opposite = face.side.value;
    for (std::uint32_t s = brush->first_side; s < brush->first_side + brush->side_count; ++s)
        if (const double cosine = dot(own, normal(s)); cosine < least) least = cosine, opposite = s;
    const Material& other = world_.materials[world_.sides[opposite].material.at()];
    out.clad = !never_drawn(other) && pane_opacity(world_, other, *brush);
    return out;
}

Panes::Triangle Panes::place(std::uint32_t t) const {
    Triangle out;
    out.triangle = t;
    const Face& face = surfaces_.faces[surfaces_.triangle_face[t].at()];
    if (face.curved()) {
        const auto& corner = surfaces_.triangles[t];
        const auto& uv = surfaces_.corners_of(t);
        const Vec3 a = surfaces_.positions[corner[0]], b = surfaces_.positions[corner[1]] - a, c = surfaces_.positions[corner[2]] - a;
        const Vec3 n = cross(b, c);
        const double area = dot(n, n);
        if (!(area > 0)) return out;
        const Vec3 gb = cross(c, n) / area, gc = cross(n, b) / area; // gradients of the weights of b and c
        const Vec2 ub = uv[1].uv - uv[0].uv, uc = uv[2].uv - uv[0].uv;
        out.gu = gb * ub.x + gc * uc.x, out.gv = gb * ub.y + gc * uc.y;
        out.u = uv[0].uv.x - dot(out.gu, a), out.v = uv[0].uv.y - dot(out.gv, a);
    } else if (face.side.valid()) {
        const DocTexture& texture = world_.sides[face.side.at()].texture;
        const Material& m = world_.materials[face.material.at()];
        out.gu = texture.u_axis / (texture.u_scale * std::max(1, m.width)), out.gv = texture.v_axis / (texture.v_scale * std::max(1, m.height));
        out.u = texture.u_shift / std::max(1, m.width), out.v = texture.v_shift / std::max(1, m.height);
    }
    const auto usable = [](Vec3 v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); };
    if (!usable(out.gu) || !usable(out.gv) || !std::isfinite(out.u) || !std::isfinite(out.v)) out.gu = out.gv = {}, out.u = out.v = 0;
    return out;
}

namespace {
struct Crossed : RTCIntersectContext {
    std::vector<std::uint32_t>* primitives = nullptr;
};
void note_crossing(const RTCFilterFunctionNArguments* args) { // one ray
    static_cast<Crossed*>(args->context)->primitives->push_back(RTCHitN_primID(args->hit, args->N, 0));
    args->valid[0] = 0; // go on
}
} // namespace

void Panes::build(RTCDevice device, const std::vector<float>& vertices, std::size_t count, Vec3 center) {
    if (triangles_.empty()) return;
    center_ = center;
    scene_ = rtcNewScene(device);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_MEDIUM); // the best would cut triangles in two and meet both parts
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, vertices.data(), 0, 3 * sizeof(float), count);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices_.data(), 0, 3 * sizeof(std::uint32_t), triangles_.size());
    rtcSetGeometryIntersectFilterFunction(geometry, note_crossing);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
}

void Panes::along(Vec3 origin, Vec3 direction, double far, const Widths& widths, std::vector<PaneHit>& out) const {
    out.clear();
    if (!scene_) return;
    thread_local std::vector<std::uint32_t> primitives;
    primitives.clear();
    Crossed context;
    rtcInitIntersectContext(&context);
    context.primitives = &primitives;
    RTCRayHit ray;
    const Vec3 o = origin - center_;
    ray.ray.org_x = static_cast<float>(o.x), ray.ray.org_y = static_cast<float>(o.y), ray.ray.org_z = static_cast<float>(o.z);
    ray.ray.dir_x = static_cast<float>(direction.x), ray.ray.dir_y = static_cast<float>(direction.y), ray.ray.dir_z = static_cast<float>(direction.z);
    ray.ray.tnear = 0, ray.ray.tfar = far < 1e30 ? static_cast<float>(far) : std::numeric_limits<float>::infinity();
    ray.ray.time = 0, ray.ray.mask = UINT32_MAX, ray.ray.id = 0, ray.ray.flags = 0;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID, ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_, &context, &ray);
    for (const std::uint32_t p : primitives) {
        const Triangle& t = triangles_[p];
        PaneHit hit;
        hit.hit.triangle = t.triangle, hit.hit.face = surfaces_.triangle_face[t.triangle];
        const Face& face = surfaces_.faces[hit.hit.face.at()];
        const double cosine = dot(face.normal, direction);
        if (std::abs(cosine) < 1e-12) continue; // in its plane
        hit.front = cosine < 0;
        const OfFace& of = face_skin_[hit.hit.face.at()];
        if (!hit.front && of.clad) continue;
        hit.hit.distance = std::max(0.0, (face.distance - dot(face.normal, origin)) / cosine);
        if (!(hit.hit.distance < far)) continue;
        hit.hit.position = origin + direction * hit.hit.distance;
        // Through the edge that two triangles share both are met: a plane is crossed once.
        const auto same = [&](const PaneHit& other) {
            if (other.hit.face == hit.hit.face) return true;
            return face.side.valid() && !face.curved() && surfaces_.faces[other.hit.face.at()].side == face.side;
        };
        if (std::ranges::any_of(out, same)) continue;
        // The bundle where it meets the pane: the squares it starts and ends in, scaled and carried along the ray into the plane.
        Vec2 square;
        const auto widen = [&](Vec3 normal, double width) {
            if (!(width > 0)) return;
            const Frame frame = frame_around(normal == Vec3{} ? direction : normal);
            for (const Vec3 edge : {frame.t * width, frame.b * width}) {
                const double slope = std::copysign(std::max(std::abs(cosine), kLeastCosine), cosine);
                const Vec3 in_plane = edge - direction * (dot(edge, face.normal) / slope);
                const double u = dot(t.gu, in_plane), v = dot(t.gv, in_plane);
                square.x += u * u, square.y += v * v;
            }
        };
        const double share = widths.length > 0 ? std::min(1.0, hit.hit.distance / widths.length) : 0;
        widen(widths.start_normal, widths.start * (1 - share));
        widen(widths.end_normal, widths.length > 0 ? widths.end * share : widths.end * hit.hit.distance);
        skins_[of.skin].at({t.u + dot(t.gu, hit.hit.position), t.v + dot(t.gv, hit.hit.position)}, {std::sqrt(square.x), std::sqrt(square.y)}, &hit.opacity, &hit.through);
        if (!hit.front) hit.opacity = 0; // its light is that of its front
        out.push_back(hit);
    }
    if (out.size() > 1)
        std::ranges::sort(out, [](const PaneHit& a, const PaneHit& b) {
            return a.hit.distance != b.hit.distance ? a.hit.distance < b.hit.distance : a.hit.triangle < b.hit.triangle;
        });
}

} // namespace kiln
