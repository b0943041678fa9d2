# SPDX-License-Identifier: BSD-3-Clause
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import Distribution, find_packages, setup


class CatkinPackage(Distribution):
    """Is what package.xml says: pyproject.toml is the wheel's, whose backend is another."""

    def parse_config_files(self, filenames=None, ignore_option_errors=False):
        super().parse_config_files(filenames or self.find_config_files(), ignore_option_errors)


setup(
    distclass=CatkinPackage,
    **generate_distutils_setup(
        packages=find_packages("src", include=["kurumaisu", "kurumaisu.*"]),
        package_dir={"": "src"},
        package_data={
            "kurumaisu.bench": ["drivers/*.cpp", "drivers/*.h"],
            "kurumaisu.critic": ["report/*.html", "values/*.json"],
            "kurumaisu.viewer": ["page/*", "page/*/*"],
            "kurumaisu": ["py.typed"],
        },
    ),
)
