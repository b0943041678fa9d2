// SPDX-License-Identifier: BSD-3-Clause
// Localises a log with AMCL's libraries, as its node calls them. Compiled against amcl_sensors, amcl_map and amcl_pf.
#include <amcl/map/map.h>
#include <amcl/pf/pf.h>
#include <amcl/sensors/amcl_laser.h>
#include <amcl/sensors/amcl_odom.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>

#include "slam_log.h"

namespace {

map_t* readMap(const std::string& path) {
  const std::vector<double> values = readDoubles(path);
  map_t* map = map_alloc();
  map->size_x = static_cast<int>(values.at(0));
  map->size_y = static_cast<int>(values.at(1));
  map->scale = values.at(2);
  map->origin_x = values.at(3) + (map->size_x / 2) * map->scale;
  map->origin_y = values.at(4) + (map->size_y / 2) * map->scale;
  const std::size_t cells = static_cast<std::size_t>(map->size_x) * static_cast<std::size_t>(map->size_y);
  map->cells = static_cast<map_cell_t*>(std::calloc(cells, sizeof(map_cell_t)));
  for (std::size_t i = 0; i < cells; ++i) {
    const double value = values.at(5 + i);
    map->cells[i].occ_state = value == 0 ? -1 : (value == 100 ? 1 : 0);
  }
  return map;
}

pf_vector_t uniformPose(void* map_pointer) {
  auto* map = static_cast<map_t*>(map_pointer);
  for (;;) {
    const int i = static_cast<int>(drand48() * map->size_x), j = static_cast<int>(drand48() * map->size_y);
    if (map->cells[MAP_INDEX(map, i, j)].occ_state != -1) continue;
    return {{MAP_WXGX(map, i), MAP_WYGY(map, j), drand48() * 2 * M_PI - M_PI}};
  }
}

pf_vector_t vectorOf(const Pose& pose) { return {{pose.x, pose.y, pose.theta}}; }

/// The node's laserReceived().
class Amcl {
 public:
  Amcl(Arguments& from, const Log& log)
      : log_(log),
        map_(readMap(from.text("map"))),
        max_beams_(static_cast<std::size_t>(from.number("laser_max_beams"))),
        laser_(max_beams_, map_),
        update_min_d_(from.number("update_min_d")),
        update_min_a_(from.number("update_min_a")),
        resample_interval_(static_cast<int>(from.number("resample_interval"))) {
    const double z_hit = from.number("laser_z_hit"), z_rand = from.number("laser_z_rand");
    const double sigma = from.number("laser_sigma_hit");
    laser_.SetModelLikelihoodField(z_hit, z_rand, sigma, from.number("laser_likelihood_max_dist"));
    pf_vector_t mount = vectorOf(log.base_from_laser);
    mount.v[2] = 0;  // the bearings have it
    laser_.SetLaserPose(mount);
    const double alpha1 = from.number("odom_alpha1"), alpha2 = from.number("odom_alpha2");
    const double alpha3 = from.number("odom_alpha3"), alpha4 = from.number("odom_alpha4");
    const bool corrected = from.text("odom_model_type") == "diff-corrected";
    odom_.SetModel(corrected ? amcl::ODOM_MODEL_DIFF_CORRECTED : amcl::ODOM_MODEL_DIFF, alpha1, alpha2,
                   alpha3, alpha4, 0.2);
    const int least = static_cast<int>(from.number("min_particles"));
    const int most = static_cast<int>(from.number("max_particles"));
    const double slow = from.number("recovery_alpha_slow"), fast = from.number("recovery_alpha_fast");
    filter_ = pf_alloc(least, most, slow, fast, (pf_init_model_fn_t)uniformPose, map_);
    filter_->pop_err = from.number("kld_err");
    filter_->pop_z = from.number("kld_z");
    pf_matrix_t covariance = pf_matrix_zero();
    covariance.m[0][0] = from.number("cov_xx");
    covariance.m[1][1] = from.number("cov_yy");
    covariance.m[2][2] = from.number("cov_aa");
    const double x = from.number("x"), y = from.number("y");
    pf_init(filter_, vectorOf({x, y, from.number("a")}), covariance);
    srand48(static_cast<long>(from.number("seed")));  // pf_init() has seeded it with a number of its own
  }

  Pose add(std::size_t scan) {
    const Pose odom = log_.odom(scan);
    bool update = !last_;
    if (last_) {
      const pf_vector_t delta{{odom.x - last_->x, odom.y - last_->y, wrap(odom.theta - last_->theta)}};
      update = std::fabs(delta.v[0]) > update_min_d_ || std::fabs(delta.v[1]) > update_min_d_ ||
               std::fabs(delta.v[2]) > update_min_a_;
      if (update) {
        amcl::AMCLOdomData data;
        data.pose = vectorOf(odom);
        data.delta = delta;
        odom_.UpdateAction(filter_, &data);
      }
    }
    const bool first = !last_;
    if (update) weigh(scan);
    if (update) last_ = odom;
    bool resampled = false;
    if (update && ++updates_ % resample_interval_ == 0) {
      pf_update_resample(filter_);
      resampled = true;
    }
    if (resampled || first) publish(odom);
    return compose(map_from_odom_, odom);
  }

 private:
  void weigh(std::size_t scan) {
    amcl::AMCLLaserData data;
    data.sensor = &laser_;
    data.range_count = static_cast<int>(log_.beams);
    data.range_max = log_.range_max;
    data.ranges = new double[log_.beams][2];  // its destructor frees it
    for (std::size_t i = 0; i < log_.beams; ++i) {
      const double range = log_.ranges(scan)[i];
      data.ranges[i][0] = range <= log_.range_min
                              ? log_.range_max
                              : (range > log_.range_max ? std::numeric_limits<float>::max() : range);
      data.ranges[i][1] =
          wrap(log_.base_from_laser.theta + log_.angle_min + log_.angle_increment * double(i));
    }
    laser_.UpdateSensor(filter_, &data);
  }

  /// map_from_odom by the heaviest cluster.
  void publish(const Pose& odom) {
    double highest = 0;
    pf_vector_t best = pf_vector_zero();
    for (int i = 0; i < filter_->sets[filter_->current_set].cluster_count; ++i) {
      double weight = 0;
      pf_vector_t mean;
      pf_matrix_t covariance;
      if (!pf_get_cluster_stats(filter_, i, &weight, &mean, &covariance)) break;
      if (weight > highest) highest = weight, best = mean;
    }
    if (highest > 0) map_from_odom_ = compose({best.v[0], best.v[1], best.v[2]}, inverse(odom));
  }

  const Log& log_;
  map_t* map_;
  std::size_t max_beams_;
  amcl::AMCLLaser laser_;
  amcl::AMCLOdom odom_;
  pf_t* filter_ = nullptr;
  double update_min_d_, update_min_a_;
  int resample_interval_, updates_ = 0;
  std::optional<Pose> last_;
  Pose map_from_odom_{0, 0, 0};
};

void run(int count, char** words) {
  Arguments from(count, words);
  const Log log(from.text("log"));
  const std::string poses_to = from.text("poses");
  Amcl amcl(from, log);
  from.end();
  std::vector<double> poses;
  const double start = processorTime();
  for (std::size_t i = 0; i < log.scans; ++i) {
    const Pose pose = amcl.add(i);
    poses.insert(poses.end(), {pose.x, pose.y, pose.theta});
  }
  printCosts(processorTime() - start, log);
  writeDoubles(poses_to, poses);
}

}  // namespace

int main(int count, char** words) { return exitStatus(run, count, words); }
