"""The simulated rig: set-valued friction, finely integrated, recorded by a drive and a camera.

It shares the mechanics with the identified models, but neither the physics step nor the laws.
"""

from .dataset_folder import check_dataset_folder, load_rig, write_dataset
from .rig import Camera, Drive, Rig, Run, Variation, noise_free
from .simulation import simulate
from .torques import Chirp, Controller, Fourier, Multisine, Noise, Sine, Steps, sampled_loop
from .true_friction import Curve, FilmLag, LoadFriction, LuGre, Stribeck, TrueFriction
