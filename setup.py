# SPDX-License-Identifier: BSD-3-Clause
from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

setup(
    **generate_distutils_setup(
        packages=find_packages("src", include=["kurumaisu", "kurumaisu.*"]),
        package_dir={"": "src"},
        package_data={
            "kurumaisu.bench": ["drivers/*.cpp", "drivers/*.h"],
            "kurumaisu.critic": ["report/*.html", "values/*.json"],
            "kurumaisu.viewer": ["page/*", "page/*/*"],
            "kurumaisu": ["py.typed"],
        },
    )
)
