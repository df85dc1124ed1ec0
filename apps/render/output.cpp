#include "apps/render/output.h"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/render/process.h"
#include "core/error.h"
#include "core/image_write.h"

namespace nephroid {

namespace {

std::vector<ImageLayer> layers_of(const Film& film) {
    const AovSelection& aovs = film.aovs();
    std::vector<ImageLayer> layers{{"", "RGB", film.beauty()}};
    if (aovs.albedo) layers.push_back({"albedo", "RGB", film.albedo()});
    if (aovs.normal) layers.push_back({"normal", "XYZ", film.normal()});
    if (aovs.depth) layers.push_back({"depth", "Z", film.depth()});
    if (aovs.caustic) layers.push_back({"caustic", "RGB", film.caustic()});
    if (aovs.variance) layers.push_back({"variance", "RGB", film.variance()});
    if (aovs.spp) layers.push_back({"spp", "Y", film.spp()});
    return layers;
}

std::vector<ImageAttribute> attributes_of(const RenderReport& report) {
    return {{"nephroid/version", NEPHROID_VERSION},
            {"nephroid/scene", report.options.scene},
            {"nephroid/integrator", report.options.integrator},
            {"nephroid/parameters", to_text(report.parameters)},
            {"nephroid/max_depth", std::to_string(report.options.max_depth)},
            {"nephroid/seed", std::to_string(report.options.seed)},
            {"nephroid/spp", std::to_string(report.film.min_spp())},
            {"nephroid/seconds", std::to_string(report.result.render_seconds)},
            {"nephroid/stop_reason", report.result.stop_reason}};
}

nlohmann::json error_json(const ImageError& error) {
    return {{"rmse", error.rmse}, {"relmse", error.relmse}, {"relmse_trimmed", error.relmse_trimmed}};
}

nlohmann::json passes_json(const RenderResult& result) {
    nlohmann::json passes = nlohmann::json::array();
    for (const PassRecord& pass : result.passes) {
        nlohmann::json entry{{"seconds", pass.seconds}, {"spp", pass.spp}};
        if (pass.error) entry.update(error_json(*pass.error));
        passes.push_back(entry);
    }
    return passes;
}

}  // namespace

void write_outputs(const RenderReport& report, const std::vector<std::string>& outputs) {
    const Film& film = report.film;
    for (const std::string& path : outputs) {
        if (std::filesystem::path(path).extension() == ".png") {
            write_png(path, film.crop().width(), film.crop().height(), film.beauty());
        } else {
            write_exr(path, film.image_width(), film.image_height(), film.crop(), layers_of(film),
                      attributes_of(report));
        }
    }
}

void write_statistics(const RenderReport& report, const std::string& path) {
    const Options& options = report.options;
    const double total = std::chrono::duration<double>(std::chrono::steady_clock::now() - report.process_start).count();
    nlohmann::json json{
        {"scene", options.scene},
        {"integrator", options.integrator},
        {"version", NEPHROID_VERSION},
        {"width", report.film.image_width()},
        {"height", report.film.image_height()},
        {"spp", report.film.min_spp()},
        {"seed", options.seed},
        {"threads", options.threads},
        {"stop_reason", report.result.stop_reason},
        {"seconds",
         {{"load", report.load_seconds},
          {"build", report.build_seconds},
          {"precompute", report.precompute_seconds},
          {"render", report.result.render_seconds},
          {"write", report.write_seconds},
          {"total", total}}},
        {"rays", report.result.rays},
        {"camera_samples", report.film.sample_count()},
        {"nonfinite_samples", report.film.nonfinite_samples()},
        {"peak_rss_bytes", peak_resident_bytes()},
        {"passes", passes_json(report.result)},
        {"parameters", report.parameters},
    };
    if (!report.result.passes.empty() && report.result.passes.back().error) {
        json["error"] = error_json(*report.result.passes.back().error);
    }
    if (report.integrator_statistics) {
        nlohmann::json& group = json[report.integrator_statistics->group];
        for (const auto& [name, count] : report.integrator_statistics->counts) group[name] = count;
        for (const auto& [name, measure] : report.integrator_statistics->measures) group[name] = measure;
    }
    const std::string temporary = temporary_path(path);
    std::ofstream file(temporary);
    file << json.dump(2) << "\n";
    file.close();
    if (!file.good()) {
        std::remove(temporary.c_str());
        throw Error(ExitCode::output_failed, path + ": statistics: cannot be written; check space and permissions");
    }
    commit_file(temporary, path);
}

}  // namespace nephroid
