// SPDX-License-Identifier: BSD-3-Clause
#include "slam/mapping/filter.h"

#include <mrpt/bayes/CParticleFilter.h>
#include <mrpt/maps/CMultiMetricMapPDF.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPosePDFGaussian.h>
#include <mrpt/random.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "slam/basics/pose.h"
#include "slam/mapping/grid.h"
#include "slam/mapping/observation.h"

namespace kurumaisu {
namespace {

using mrpt::bayes::CParticleFilter;
using mrpt::maps::CMultiMetricMapPDF;
using mrpt::maps::COccupancyGridMap2D;

CParticleFilter::TParticleFilterOptions filterOptions(const MapperSettings& s) {
  CParticleFilter::TParticleFilterOptions options;
  options.adaptiveSampleSize = false;
  options.sampleSize = static_cast<unsigned>(s.particles);
  options.PF_algorithm = CParticleFilter::pfStandardProposal;
  options.resamplingMethod = CParticleFilter::prSystematic;
  options.BETA = s.resample_below;
  options.powFactor = s.likelihood_power;
  return options;
}

mrpt::maps::TSetOfMetricMapInitializers mapDefinition(const MapperSettings& s) {
  COccupancyGridMap2D::TMapDefinition grid;
  grid.resolution = static_cast<float>(s.resolution);
  // It grows as scans come in.
  grid.min_x = grid.min_y = -1;
  grid.max_x = grid.max_y = 1;
  setInsertion(grid.insertionOpts, s);
  grid.likelihoodOpts.likelihoodMethod = COccupancyGridMap2D::lmLikelihoodField_Thrun;
  grid.likelihoodOpts.LF_stdHit = static_cast<float>(s.hit_deviation);
  grid.likelihoodOpts.LF_zHit = static_cast<float>(s.hit_share);
  grid.likelihoodOpts.LF_zRandom = static_cast<float>(1 - s.hit_share);
  grid.likelihoodOpts.LF_maxRange = static_cast<float>(s.range);
  grid.likelihoodOpts.LF_maxCorrsDistance = static_cast<float>(s.hit_reach);
  grid.likelihoodOpts.LF_decimation = static_cast<std::uint32_t>(s.hit_every);
  grid.likelihoodOpts.enableLikelihoodCache = false;
  mrpt::maps::TSetOfMetricMapInitializers maps;
  maps.push_back(grid);
  return maps;
}

mrpt::obs::CActionCollection action(const MapperSettings& s, const Pose2D& motion,
                                    const Eigen::Matrix3d& more) {
  mrpt::obs::CActionRobotMovement2D::TMotionModelOptions model;
  model.modelSelection = mrpt::obs::CActionRobotMovement2D::mmGaussian;
  model.gaussianModel.a1 = static_cast<float>(s.distance_per_distance);
  model.gaussianModel.a2 = static_cast<float>(s.distance_per_angle);
  model.gaussianModel.a3 = static_cast<float>(s.angle_per_distance);
  model.gaussianModel.a4 = static_cast<float>(s.angle_per_angle);
  model.gaussianModel.minStdXY = static_cast<float>(s.distance_floor);
  model.gaussianModel.minStdPHI = static_cast<float>(s.angle_floor);
  mrpt::obs::CActionRobotMovement2D movement;
  movement.computeFromOdometry({motion.x, motion.y, wrapAngle(motion.theta)}, model);
  auto& drawn = dynamic_cast<mrpt::poses::CPosePDFGaussian&>(*movement.poseChange);
  for (int i = 0; i < 9; ++i) drawn.cov(i / 3, i % 3) += more(i / 3, i % 3);
  mrpt::obs::CActionCollection actions;
  actions.insert(movement);
  return actions;
}

Pose2D poseOf(const mrpt::math::TPose3D& pose) { return {pose.x, pose.y, pose.yaw}; }

/// No cell of a map that was read is beyond doubt: what was moved since must not take hours to vanish.
constexpr double kDoubt = 0.1;

void fill(COccupancyGridMap2D& grid, const OccupancyGrid& map) {
  const double right = map.x + map.width * map.resolution;
  const double top = map.y + map.height * map.resolution;
  grid.setSize(static_cast<float>(map.x), static_cast<float>(right), static_cast<float>(map.y),
               static_cast<float>(top), static_cast<float>(map.resolution));
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const double cell = map.cells[static_cast<std::size_t>(y) * map.width + x];
      if (cell < 0) continue;
      grid.setCell(x, y, static_cast<float>(std::clamp(1 - cell / 100, kDoubt, 1 - kDoubt)));
    }
  }
}

}  // namespace

struct Filter::Particles {
  explicit Particles(const MapperSettings& s) : pdf(filterOptions(s), mapDefinition(s), {}) {
    filter.m_options = filterOptions(s);
    filter.setMinLoggingLevel(mrpt::system::LVL_ERROR);
  }

  const mrpt::maps::CRBPFParticleData& best() const {
    const auto heavier = [](const auto& a, const auto& b) { return a.log_w < b.log_w; };
    return *std::max_element(pdf.m_particles.begin(), pdf.m_particles.end(), heavier)->d;
  }

  CMultiMetricMapPDF pdf;
  CParticleFilter filter;
};

Filter::Filter(const MapperSettings& settings, std::uint32_t seed, const Pose2D& map_from_base)
    : settings_(settings), seed_(seed), particles_(std::make_unique<Particles>(settings)) {
  particles_->pdf.clear(mrpt::poses::CPose2D(map_from_base.x, map_from_base.y, map_from_base.theta));
}
Filter::~Filter() = default;

void Filter::resume(const OccupancyGrid& map, const Gaussian& map_from_base) {
  seedRandom();
  const Eigen::LLT<Eigen::Matrix3d> root(map_from_base.covariance);
  const COccupancyGridMap2D* first = nullptr;
  for (auto& particle : particles_->pdf.m_particles) {
    auto& random = mrpt::random::getRandomGenerator();
    const Eigen::Vector3d draw(random.drawGaussian1D_normalized(), random.drawGaussian1D_normalized(),
                               random.drawGaussian1D_normalized());
    const Eigen::Vector3d off = root.matrixL() * draw;
    const Pose2D& mean = map_from_base.mean;
    particle.d->robotPath.back() =
        mrpt::math::TPose3D(mean.x + off(0), mean.y + off(1), 0, wrapAngle(mean.theta + off(2)), 0, 0);
    auto& grid = *particle.d->mapTillNow.mapByClass<COccupancyGridMap2D>();
    if (first == nullptr) {
      fill(grid, map);
      first = &grid;
    } else {
      grid.copyMapContentFrom(*first);
    }
  }
}

void Filter::localise(const Scan& scan, const Pose2D& motion, const Eigen::Matrix3d& more) {
  seedRandom();
  const auto actions = action(settings_, motion, more);
  mrpt::obs::CSensoryFrame frame;
  frame.insert(likelihoodObservation(scan));
  particles_->filter.executeOn(particles_->pdf, &actions, &frame);
}

void Filter::insert(const Scan& scan) {
  // Not pdf.insertObservation(), which keeps every scan, and where all particles then were, beside their maps.
  const auto observation = insertionObservation(scan, settings_.range);
  for (auto& particle : particles_->pdf.m_particles) {
    const mrpt::poses::CPose3D pose(particle.d->robotPath.back());
    particle.d->mapTillNow.insertObservation(*observation, pose);
  }
}

/// MRPT's generator belongs to the thread and keeps half a pair of normal draws over a new seed, so it is
/// replaced before every use: the result depends neither on the thread nor on who drew before.
void Filter::seedRandom() {
  constexpr std::uint32_t kGolden = 2654435769U;  // spreads consecutive rounds over the seeds
  mrpt::random::getRandomGenerator() = mrpt::random::CRandomGenerator(seed_ + kGolden * ++rounds_);
}

Pose2D Filter::bestPose() const { return poseOf(particles_->best().robotPath.back()); }

std::vector<Pose2D> Filter::bestPath() const {
  std::vector<Pose2D> path;
  for (const auto& pose : particles_->best().robotPath) path.push_back(poseOf(pose));
  return path;
}

std::size_t Filter::nodes() const { return particles_->best().robotPath.size(); }

std::array<double, 9> Filter::covarianceAt(std::size_t node) const {
  const Pose2D centre = poseOf(particles_->best().robotPath.at(node));
  std::array<double, 9> sum{};
  double total = 0;
  for (const auto& particle : particles_->pdf.m_particles) {
    const Pose2D pose = poseOf(particle.d->robotPath.at(node));
    const std::array<double, 3> offset{pose.x - centre.x, pose.y - centre.y,
                                       wrapAngle(pose.theta - centre.theta)};
    const double weight = std::exp(particle.log_w);
    total += weight;
    for (int i = 0; i < 9; ++i) sum[i] += weight * offset[i / 3] * offset[i % 3];
  }
  for (double& value : sum) value /= total;
  return sum;
}

std::vector<std::array<double, 9>> Filter::pathCovariances() const {
  std::vector<std::array<double, 9>> out;
  out.reserve(nodes());
  for (std::size_t node = 0; node < nodes(); ++node) out.push_back(covarianceAt(node));
  return out;
}

std::vector<Weighted> Filter::particles() const {
  std::vector<Weighted> out;
  double total = 0;
  for (const auto& particle : particles_->pdf.m_particles) {
    out.push_back({poseOf(particle.d->robotPath.back()), std::exp(particle.log_w)});
    total += out.back().weight;
  }
  for (Weighted& each : out) each.weight /= total;
  return out;
}

double Filter::entropy() const {
  double sum = 0;
  for (const Weighted& each : particles()) {
    if (each.weight > 0) sum -= each.weight * std::log(each.weight);
  }
  return sum;
}

OccupancyGrid Filter::grid() const {
  return occupancyOf(*particles_->best().mapTillNow.mapByClass<COccupancyGridMap2D>());
}

}  // namespace kurumaisu
