// The sweeps, by what they are about. Each fills in panels and notes.
#pragma once
#include "tools/stability_bench/scenes.h"
#include "tools/stability_bench/stability.h"

namespace kiln::bench {

// A point of the series of that name, which begins with its first.
void add_point(Panel& panel, const std::string& name, std::size_t look, double x, double y);
// Of a sweep: all values, or in a quick run only these.
std::vector<double> values_of(const SweepSettings& settings, std::vector<double> all, std::vector<double> few);

// edges.cpp: closed forms near edges, at the horizon, and of the corridor
void sweep_touching_faces(SweepReport& r, const SweepSettings& s, Context& context);   // F1
void sweep_horizon(SweepReport& r, const SweepSettings& s, Context& context);          // F8
void sweep_smoothing(SweepReport& r, const SweepSettings& s, Context& context);        // F9
// transport.cpp: bounces
void sweep_furnaces(SweepReport& r, const SweepSettings& s, Context& context);         // F2
void sweep_small_lamp(SweepReport& r, const SweepSettings& s, Context& context);       // F7
// Irradiance along the wall of a circular tube of diameter 1, at x from an end of exitance 1; the other end is black.
std::vector<double> tube_irradiance(double length, double albedo, std::span<const double> x);
void sweep_corridor(SweepReport& r, const SweepSettings& s, Context& context);         // F11
void sweep_settings(SweepReport& r, const SweepSettings& s, Context& context);         // F12
// walls.cpp: what must stay dark
void sweep_wall_thickness(SweepReport& r, const SweepSettings& s, Context& context);   // F3
void sweep_dark_box(SweepReport& r, const SweepSettings& s, Context& context);         // F4
void sweep_fans(SweepReport& r, const SweepSettings& s, Context& context);             // F5
// shapes.cpp: shapes and coordinates
void sweep_needles(SweepReport& r, const SweepSettings& s, Context& context);          // F6
void sweep_placing(SweepReport& r, const SweepSettings& s, Context& context);          // F10
void sweep_degenerate(SweepReport& r, const SweepSettings& s, Context& context);       // F16
// places.cpp: ambient cubes and probes
void sweep_ambient_lattice(SweepReport& r, const SweepSettings& s, Context& context);  // F13
void sweep_probes(SweepReport& r, const SweepSettings& s, Context& context);           // F14

} // namespace kiln::bench
