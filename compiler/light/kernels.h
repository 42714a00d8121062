// Kernels: what an incoming ray adds to the numbers stored for a luxel.
//
// All encodings are linear in the incoming light, l_i = integral of L(w) K_i(w), so that one bundle of rays serves
// the flat value and the three directional ones. Frames: local z is the shading normal; the basis is
//     b0 = (sqrt(2/3), 0, 1/sqrt 3)   b1,2 = (-1/sqrt 6, +-1/sqrt 2, 1/sqrt 3).
//
// dot      E~(n) = sum l_i (b_i . n). K_i = cos+/sqrt 3 + g(theta) (b_i,t . phi^), the least-squares fit of the
//          irradiance of all normals within a cone subject to E~(z) = E(z); sum l_i / sqrt 3 is E(z) identically.
// sq       E~(n) = sum w_i l_i / sum w_i, w_i = max(0, b_i . n)^2. Accumulated: m_i = integral of p(n) w^_i E(n)
//          (linear); stored: the non-negative least squares vector whose mean is E(z) (`finish`).
// tilted   l_i = E(b_i).
#pragma once
#include "compiler/light/light.h"
#include <algorithm>
#include <memory>
#include <numbers>

namespace kiln {

constexpr double kInvSqrt3 = 0.57735026918962576;
inline const std::array<Vec3, 3> kRnmBasis{Vec3{std::sqrt(2.0 / 3), 0, 1 / std::sqrt(3.0)},
                                           Vec3{-1 / std::sqrt(6.0), 1 / std::sqrt(2.0), 1 / std::sqrt(3.0)},
                                           Vec3{-1 / std::sqrt(6.0), -1 / std::sqrt(2.0), 1 / std::sqrt(3.0)}};

struct KernelSum {
    static constexpr bool kRawBytes = true;
    Rgbd flat;
    std::array<Rgbd, 3> rnm{};
    KernelSum& operator+=(const KernelSum& o) {
        flat += o.flat;
        for (std::size_t i = 0; i < 3; ++i) rnm[i] += o.rnm[i];
        return *this;
    }
    KernelSum& operator*=(double s) { return *this *= Rgbd{s, s, s}; }
    KernelSum& operator*=(Rgbd s) {
        flat = flat * s;
        for (Rgbd& r : rnm) r = r * s;
        return *this;
    }
};

// As it is kept, in a memo or by a bake without one.
struct StoredSum {
    static constexpr bool kRawBytes = true;
    Rgb flat;
    std::array<Rgb, 3> rnm{};
    StoredSum() = default;
    explicit StoredSum(const KernelSum& s) : flat(static_cast<Rgb>(s.flat)) {
        for (std::size_t i = 0; i < 3; ++i) rnm[i] = static_cast<Rgb>(s.rnm[i]);
    }
    KernelSum sum() const {
        KernelSum s;
        s.flat = static_cast<Rgbd>(flat);
        for (std::size_t i = 0; i < 3; ++i) s.rnm[i] = static_cast<Rgbd>(rnm[i]);
        return s;
    }
};

// Tables of one cone of normals (uniform over the cone, weights sum to one).
class ConeTable {
public:
    ConeTable(RnmEncoding encoding, double cone_deg);
    double cone_deg() const { return cone_deg_; }
    // g(theta) / sin(theta): 1 wherever no normal of the cone loses the light behind its horizon.
    double tangential(double cos_theta) const {
        const double x = (cos_theta + 1) * (0.5 * kNodes);
        const int i = std::clamp(static_cast<int>(x), 0, kNodes - 1);
        const double f = std::clamp(x - i, 0.0, 1.0);
        const auto k = static_cast<std::size_t>(i);
        return tangential_[k] + (tangential_[k + 1] - tangential_[k]) * f;
    }
    double moment(double cos_theta, double azimuth_turns) const; // of basis vector 0, sq
    double gram_scale() const { return gram_scale_; }            // a - b of the Gram matrix of the w^_i
    double uniform_moment() const { return uniform_moment_; } // integral of the moment kernel over the hemisphere

private:
    static constexpr int kNodes = 512, kRows = 64, kColumns = 96;
    double cone_deg_ = 0;
    std::vector<double> tangential_;
    std::vector<float> moment_;
    double gram_scale_ = 1, uniform_moment_ = 0;
};

// The flat kernel and the three directional ones for a direction (0 where there is no cone). In registers: an array written number by number and read
// in pairs waits for its own writes.
struct KernelValues {
    using Pair [[gnu::vector_size(16)]] = double;
    Pair flat_first{}, second_third{};
    double operator[](std::size_t i) const { return i < 2 ? flat_first[i] : second_third[i - 2]; }
    void add(const KernelValues& o, double weight) { flat_first += o.flat_first * weight, second_third += o.second_third * weight; }
};

// The kernel of one luxel.
struct LuxelKernel {
    Frame frame; // around the shading normal
    RnmEncoding encoding = RnmEncoding::dot;
    const ConeTable* cone = nullptr; // none: flat only
    void fields(ByteWriter& w) const; // all that it is made of
    KernelValues values(Vec3 direction) const;
    // Does one of them bend over what lies in a ball, as seen from its luxel? Irradiance along the basis does at the horizon of each basis vector.
    bool bends_over(Vec3 to_center, double radius) const {
        return cone && encoding == RnmEncoding::tilted &&
               std::ranges::any_of(kRnmBasis, [&](Vec3 b) { return std::abs(dot(frame.world(b), to_center)) < radius; });
    }
    // Their integrals over the hemisphere of frame.n.
    std::array<double, 4> integrals() const;
    // Light from `direction` (unit): `weight` = radiance times solid angle.
    void add(KernelSum& sum, Vec3 direction, Rgbd weight) const {
        add(sum, values(direction), weight);
    }
    void add(KernelSum& sum, const KernelValues& k, Rgbd weight) const { // k: its values
        sum.flat += weight * k[0];
        if (!cone) return;
        for (std::size_t i = 0; i < 3; ++i) sum.rnm[i] += weight * k[i + 1];
    }
    // From the sums to what is stored.
    std::array<Rgb, 3> finish(const KernelSum& sum) const;
    // What is seen of it, to measure errors by: along the shading normal and, where there is a cone, along three tilted
    // normals: the basis vectors where their irradiance is stored, else those on their azimuths that lean by kTypicalTilt.
    std::array<Rgbd, 4> shown(const KernelSum& sum) const;
    // The same of values as they are stored.
    std::array<Rgbd, 4> shown(Rgbd flat, const std::array<Rgbd, 3>& stored) const;
    // As a run time shows these: what the formula of `dot` puts below 0, along normals away from the light, is black.
    static std::array<Rgbd, 4> displayed(std::array<Rgbd, 4> shown) {
        for (Rgbd& e : shown) e = {std::max(0.0, e.x), std::max(0.0, e.y), std::max(0.0, e.z)};
        return shown;
    }
    std::size_t shown_count() const { return cone ? 4 : 1; }
};
constexpr double kTypicalTilt = 0.354; // sine of 20.7 degrees, the root mean square tilt within a cone of 30

inline KernelValues LuxelKernel::values(Vec3 direction) const {
    const double cosine = dot(direction, frame.n), positive = std::max(0.0, cosine);
    using Pair = KernelValues::Pair;
    if (!cone) return {Pair{positive, 0}, Pair{}};
    const double x = dot(direction, frame.t), y = dot(direction, frame.b);
    const auto each = [&](const auto& of) { return KernelValues{Pair{positive, of(std::size_t{0})}, Pair{of(std::size_t{1}), of(std::size_t{2})}}; };
    if (encoding == RnmEncoding::dot) {
        const double r = cone->tangential(cosine);
        return each([&](std::size_t i) { return positive * kInvSqrt3 + r * (kRnmBasis[i].x * x + kRnmBasis[i].y * y); });
    }
    if (encoding == RnmEncoding::tilted) return each([&](std::size_t i) { return std::max(0.0, dot(kRnmBasis[i], Vec3{x, y, cosine})); });
    const double turns = std::atan2(y, x) / (2 * std::numbers::pi);
    return each([&](std::size_t i) { return cone->moment(cosine, turns - static_cast<double>(i) / 3); });
}

// The flat value and what the directional ones say for the flat normal are one thing (not under `tilted`): moves these to it, as little as possible.
void follow_flat(RnmEncoding encoding, Rgbd flat, std::array<Rgbd, 3>& rnm);

// Per chart, the table of the cone that the normals of its materials' normal maps lie in; none: flat light only.
std::vector<std::shared_ptr<const ConeTable>> cone_tables(const World& world, const Surfaces& surfaces, Directional directional, RnmEncoding encoding);

// E~ of stored values for a local normal (unit): the run-time formulas.
Rgbd rnm_evaluate(RnmEncoding encoding, const std::array<Rgb, 3>& stored, Vec3 local_normal);

} // namespace kiln
