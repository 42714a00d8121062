// Panes: faces that let a part of the light through (glass, grates, tinted water). They are a ray scene of their own beside that of what
// blocks, so that a map without them is traced as if there were none. Private to this folder; what they do to light: NOTES.md.
#pragma once
#include "compiler/light/field.h"
#include <embree3/rtcore.h>

namespace kiln {

// Means of a texture over rectangles, from a table of sums: exact for texels taken as squares, whatever the size, repeats included.
class TexelSums {
public:
    TexelSums() = default;
    TexelSums(int width, int height, const Bytes& texels);
    // Over a rectangle about `middle` (repeats of the texture); of no size: the texel there. 0..1
    double mean(Vec2 middle, Vec2 size) const;

private:
    double below(double x, double y) const; // sum over [0,x] x [0,y], texels, within one repeat
    double across(double x, double y) const; // the same, over any number of repeats
    int width_ = 0, height_ = 0;
    std::vector<std::uint32_t> sum_; // (width + 1) x (height + 1)
};

// What a material lets through.
class PaneSkin {
public:
    PaneSkin(const Material& material, double opacity); // `opacity`: of the entity
    bool opaque() const { return opaque_; }
    bool clear() const { return clear_; } // as if it were not there
    void at(Vec2 uv, Vec2 size, double* opacity, Rgbd* through) const;

private:
    double alpha_ = 1;
    Rgbd tint_{1, 1, 1};
    bool mapped_ = false, coloured_ = false, opaque_ = false, clear_ = false;
    TexelSums opacity_;
    std::array<TexelSums, 3> through_; // where the tint differs from texel to texel
};

class Panes {
public:
    Panes(const World& world, const Surfaces& surfaces);
    ~Panes();
    Panes(const Panes&) = delete;
    Panes& operator=(const Panes&) = delete;
    bool empty() const { return triangles_.empty(); }
    enum class Kind : std::uint8_t { other, pane, blocks, clear };
    Kind kind(FaceId face) const { return face_skin_[face.at()].kind; }
    // Vertices as the blockers have them: about `center`.
    void build(RTCDevice device, const std::vector<float>& vertices, std::size_t count, Vec3 center);
    void along(Vec3 origin, Vec3 direction, double far, const Widths& widths, std::vector<PaneHit>& out) const;

private:
    struct OfFace {
        Kind kind = Kind::other;
        bool clad = false; // the way out of a brush whose way in has been counted
        std::uint32_t skin = UINT32_MAX;
    };
    struct Triangle {
        std::uint32_t triangle = 0;
        Vec3 gu, gv; // repeats of the texture a unit
        double u = 0, v = 0;
    };
    OfFace of_face(const Face& face, std::vector<std::pair<std::uint32_t, double>>& skins);
    Triangle place(std::uint32_t triangle) const;
    const World& world_;
    const Surfaces& surfaces_;
    std::vector<OfFace> face_skin_;
    std::vector<PaneSkin> skins_;
    std::vector<Triangle> triangles_;
    std::vector<std::uint32_t> indices_;
    Vec3 center_;
    RTCScene scene_ = nullptr;
};

} // namespace kiln
