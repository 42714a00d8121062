#include "compiler/lights/falloff.h"
#include "compiler/lights/lights.h"

namespace kiln {

Quadratic falloff_by_distances(double half, double zero) {
    constexpr double kAtZero = 1, kAtHalf = 2, kAtEnd = 256;
    constexpr int kBlends = 20; // steps of 5 %
    const double line = kAtZero + (kAtEnd - kAtZero) * half / zero;
    Quadratic f;
    for (int i = 0; i <= kBlends; ++i) {
        const double blend = static_cast<double>(i) / kBlends;
        const double middle = (1 - blend) * kAtHalf + blend * line;
        const double first = (middle - kAtZero) / half, whole = (kAtEnd - kAtZero) / zero;
        const double a = (whole - first) / (zero - half);
        f = {kAtZero, first - a * half, a};
        // Rising from a distance of 1 on, where it is first used; the second test is for ends closer than 16 units.
        if (2 * f.quadratic + f.linear >= 0 && f.at(1) > 0) break;
    }
    const double scale = kAtHalf / f.at(half);
    return {f.constant * scale, f.linear * scale, f.quadratic * scale};
}

double Light::attenuation(double distance) const {
    double value = 1;
    if (falloff == Falloff::quake_linear) {
        value = range > 0 ? std::max(0.0, 1 - distance / range) : 0;
    } else if (falloff == Falloff::polynomial) {
        double d = std::max(distance, 1.0);
        // Beyond its vertex a parabola that opens downwards would brighten again, then turn negative.
        if (quadratic < 0) d = std::min(d, -linear / (2 * quadratic));
        value = 1 / (constant + d * (linear + d * quadratic));
    }
    if (fade_end > 0) {
        const double t = std::clamp((distance - fade_start) / (fade_end - fade_start), 0.0, 1.0);
        value *= 1 - t * t * t * (t * (6 * t - 15) + 10);
    }
    return value;
}

double Light::cone(Vec3 unit_from_light) const {
    if (kind != LightKind::spot) return 1;
    const double c = dot(direction, unit_from_light);
    if (c <= cos_outer) return 0;
    double fringe = 1;
    if (c < cos_inner) {
        fringe = (c - cos_outer) / (cos_inner - cos_outer);
        if (exponent != 0 && exponent != 1) fringe = std::pow(fringe, exponent);
    }
    return cone_cosine ? fringe * std::max(c, 0.0) : fringe;
}

} // namespace kiln
