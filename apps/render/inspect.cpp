#include "apps/render/inspect.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>

#include "core/error.h"
#include "core/image_write.h"
#include "integrators/guided/guided_integrator.h"

namespace nephroid {

namespace {

constexpr int hemisphere_size = 512;
constexpr int window_size = 256;
constexpr float window_lobe_widths = 8.0F;
constexpr uint32_t default_rays_per_cell = 64;

std::string option_text(const Options& options) {
    return "--inspect " + std::to_string(options.inspect->x) + "," + std::to_string(options.inspect->y);
}

using Color = std::array<float, 3>;

/// Black, purple, red, orange, pale yellow at equal steps (after "inferno" by Smith and van der Walt): lighter is more,
/// also without colour vision. sRGB.
Color heat_color(float t) {
    constexpr std::array<Color, 9> colors{{{0.001F, 0.000F, 0.014F},
                                           {0.128F, 0.047F, 0.290F},
                                           {0.342F, 0.062F, 0.429F},
                                           {0.533F, 0.134F, 0.416F},
                                           {0.736F, 0.216F, 0.330F},
                                           {0.895F, 0.364F, 0.189F},
                                           {0.978F, 0.559F, 0.035F},
                                           {0.965F, 0.797F, 0.230F},
                                           {0.988F, 0.998F, 0.645F}}};
    const float position = std::clamp(t, 0.0F, 1.0F) * static_cast<float>(colors.size() - 1);
    const size_t i = std::min(static_cast<size_t>(position), colors.size() - 2);
    const float share = position - static_cast<float>(i);
    Color color{};
    for (size_t c = 0; c < 3; ++c) color[c] = (1.0F - share) * colors[i][c] + share * colors[i + 1][c];
    return color;
}

/// Red where t is positive, blue where negative, black at zero. sRGB.
Color signed_color(float t) {
    const float strength = std::min(std::abs(t), 1.0F);
    const float strong = std::min(1.6F * strength, 1.0F), pale = std::max(2.0F * strength - 1.0F, 0.0F);
    return t > 0.0F ? Color{strong, 0.25F * strong + 0.6F * pale, 0.1F * strong + 0.6F * pale}
                    : Color{0.1F * strong + 0.6F * pale, 0.35F * strong + 0.55F * pale, strong};
}

/// The scale that a pair of density and target is shown with: from `top` down to `top` * lowest.
struct ToneScale {
    static constexpr float decades = 4.0F;
    float top = 1.0F;  ///< Per steradian.

    float logarithmic(float value) const {
        if (!(value > 0.0F)) return 0.0F;
        return 1.0F + std::log10(value / top) / decades;
    }
    float root(float difference) const { return std::copysign(std::sqrt(std::abs(difference) / top), difference); }
};

/// All but a ten-thousandth of the cells are below: single fireflies of the brute force do not set the scale.
float high_value(std::vector<float> values) {
    const auto position = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) * 9999 / 10000);
    std::nth_element(values.begin(), position, values.end());
    return *position;
}

/// Cells without a direction, so that the hemisphere's rim can be seen.
constexpr Color outside_color{0.16F, 0.16F, 0.16F};

template <class ColorOf>
void write_colors(const std::string& path, const DirectionMap& map, const std::vector<float>& values,
                  const ColorOf& color_of) {
    std::vector<uint8_t> bytes;
    bytes.reserve(3 * values.size());
    for (size_t cell = 0; cell < values.size(); ++cell) {
        for (const float channel : map.is_whole(cell) ? color_of(values[cell]) : outside_color) {
            bytes.push_back(static_cast<uint8_t>(std::lround(255.0F * std::clamp(channel, 0.0F, 1.0F))));
        }
    }
    write_png(path, map.size(), map.size(), bytes);
}

std::string vector_text(const Vec3& v) {
    char text[96];
    std::snprintf(text, sizeof text, "%.6g %.6g %.6g", double{v.x}, double{v.y}, double{v.z});
    return text;
}

std::string number_text(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", value);
    return text;
}

/// `name` is OUT.inspect; `suffix` that of the file names' ends.
void write_pictures(const std::string& name, const std::string& suffix, const DirectionPictures& pictures,
                    std::vector<ImageAttribute> attributes) {
    const int size = pictures.map.size();
    std::vector<float> difference(pictures.target.size());
    std::transform(pictures.target.begin(), pictures.target.end(), pictures.density.begin(), difference.begin(),
                   std::minus<>());
    ToneScale scale;
    const float high = std::max(high_value(pictures.density), high_value(pictures.target));
    if (high > 0.0F) scale.top = high;
    attributes.push_back({"nephroid/inspect_scale_top", number_text(double{scale.top})});
    attributes.push_back({"nephroid/inspect_scale_decades", number_text(double{ToneScale::decades})});
    write_exr(name + suffix + ".exr", size, size, {0, 0, size, size},
              {{"density", "Y", pictures.density},
               {"radiance", "RGB", pictures.radiance},
               {"target", "Y", pictures.target},
               {"difference", "Y", difference}},
              attributes);
    const auto heat = [&scale](float value) { return heat_color(scale.logarithmic(value)); };
    write_colors(name + "-density" + suffix + ".png", pictures.map, pictures.density, heat);
    write_colors(name + "-target" + suffix + ".png", pictures.map, pictures.target, heat);
    write_colors(name + "-difference" + suffix + ".png", pictures.map, difference,
                 [&scale](float value) { return signed_color(scale.root(value)); });
}

std::vector<ImageAttribute> attributes_of(const Options& options, const Parameters& parameters,
                                          const InspectedVertex& vertex, double target_integral,
                                          const InspectionSettings& settings) {
    return {{"nephroid/version", NEPHROID_VERSION},
            {"nephroid/scene", options.scene},
            {"nephroid/integrator", options.integrator},
            {"nephroid/parameters", to_text(parameters)},
            {"nephroid/max_depth", std::to_string(options.max_depth)},
            {"nephroid/seed", std::to_string(options.seed)},
            {"nephroid/spp", std::to_string(settings.rays_per_cell)},
            {"nephroid/inspect_pixel", std::to_string(options.inspect->x) + "," + std::to_string(options.inspect->y)},
            {"nephroid/inspect_position", vector_text(vertex.surface.position)},
            {"nephroid/inspect_normal", vector_text(vertex.surface.shading_normal)},
            {"nephroid/inspect_irradiance", number_text(target_integral)}};
}

std::string guide_text(const std::optional<GuideFacts>& facts, float fraction) {
    if (!facts) return "no cached point, BSDF alone";
    char text[160];
    std::snprintf(text, sizeof text, "cached point %.3g m away, %zu lobes, guide fraction %.3g",
                  double{facts->distance}, facts->lobe_count, double{fraction});
    return text;
}

std::string fit_text(const DirectionPictures& pictures, double target_integral) {
    if (!(target_integral > 0.0)) return "no light arrives";
    const DensityFit fit = measure_fit(pictures);
    char text[200];
    std::snprintf(text, sizeof text,
                  "density >= target/10 for %.2f %% of the light, relative deviation of light/density %.3g",
                  100.0 * fit.covered, fit.relative_deviation);
    return text;
}

void warn_of_nonfinite(const Options& options, uint64_t count) {
    if (count == 0) return;
    std::fprintf(stderr, "warning: %s: %llu samples were not finite and count as black\n", options.scene.c_str(),
                 static_cast<unsigned long long>(count));
}

}  // namespace

std::string inspection_path(const std::string& output) {
    return std::filesystem::path(output).replace_extension(".inspect.exr").string();
}

InspectedVertex vertex_to_inspect(const Options& options, const RenderContext& context, const PixelRegion& crop) {
    const Options::Pixel pixel = *options.inspect;
    if (pixel.x < crop.x0 || pixel.y < crop.y0 || pixel.x >= crop.x1 || pixel.y >= crop.y1) {
        throw Error(ExitCode::usage, option_text(options) + ": not in the image; choose x in " +
                                         std::to_string(crop.x0) + ".." + std::to_string(crop.x1 - 1) + " and y in " +
                                         std::to_string(crop.y0) + ".." + std::to_string(crop.y1 - 1));
    }
    const Vec2 centre(static_cast<float>(pixel.x) + 0.5F, static_cast<float>(pixel.y) + 0.5F);
    const std::optional<InspectedVertex> vertex = find_inspected_vertex(context, centre);
    if (!vertex) {
        throw Error(ExitCode::usage, option_text(options) +
                                         ": sees no surface that scatters (nothing, a lamp, black, or only mirrors); "
                                         "choose another pixel");
    }
    return *vertex;
}

void inspect_vertex(const Options& options, const Parameters& parameters, const RenderContext& context,
                    const Integrator& integrator, const InspectedVertex& vertex, const std::string& output) {
    const SurfaceInteraction& surface = vertex.surface;
    const auto* guided = dynamic_cast<const GuidedIntegrator*>(&integrator);
    const DirectionalGuide* guide = guided != nullptr ? guided->guide() : nullptr;
    std::optional<GuideFacts> facts;
    if (guide != nullptr) facts = guided->facts_at(surface.position, surface.geometric_normal);
    const std::string name = std::filesystem::path(inspection_path(output)).replace_extension().string();
    const InspectionSettings settings{options.spp.value_or(default_rays_per_cell), options.threads};

    // The top of the picture is away from the viewer.
    const DirectionMap hemisphere = DirectionMap::hemisphere(surface.shading_normal, -vertex.wo, hemisphere_size);
    DirectionPictures pictures = make_direction_pictures(context, vertex, guide, hemisphere, settings);
    warn_of_nonfinite(options, pictures.nonfinite_samples);
    const double target_integral = pictures.integral(pictures.target);
    pictures.normalise(target_integral);
    const std::vector<ImageAttribute> attributes =
        attributes_of(options, parameters, vertex, target_integral, settings);
    write_pictures(name, "", pictures, attributes);

    if (facts && facts->lobe_count > 0) {
        const float half_width = std::clamp(window_lobe_widths * facts->heaviest.width, 1e-4F, 1.0F);
        const DirectionMap window =
            DirectionMap::window(facts->heaviest.axis, surface.shading_normal, half_width, window_size);
        DirectionPictures zoomed = make_direction_pictures(context, vertex, guide, window, settings);
        warn_of_nonfinite(options, zoomed.nonfinite_samples);
        zoomed.normalise(target_integral);
        std::vector<ImageAttribute> zoomed_attributes = attributes;
        zoomed_attributes.push_back({"nephroid/inspect_axis", vector_text(facts->heaviest.axis)});
        zoomed_attributes.push_back({"nephroid/inspect_half_width", number_text(double{half_width})});
        write_pictures(name, "-zoom", zoomed, zoomed_attributes);
    }
    if (options.verbosity == Verbosity::quiet) return;
    std::fprintf(stderr, "%s: '%s' at %s: %s; %s\n", option_text(options).c_str(),
                 context.scene.objects[vertex.object].name.c_str(), vector_text(surface.position).c_str(),
                 guide_text(facts, guide_fraction_at(context, vertex, guide)).c_str(),
                 fit_text(pictures, target_integral).c_str());
}

}  // namespace nephroid
