from .dofs import Dof as Dof
from .dofs import parse_dof as parse_dof
from .errors import FrfIpzError as FrfIpzError
from .errors import InputError as InputError
from .export.state_space import load_state_space as load_state_space
from .export.state_space import save_state_space as save_state_space
from .export.state_space import to_state_space as to_state_space
from .fe.eigen import solve_modes as solve_modes
from .fe.model_file import read_model as read_model
from .fe.options import ReduceOptions as ReduceOptions
from .fe.reduction import reduce_model as reduce_model
from .fe.response import model_frfs as model_frfs
from .frf import FrfSet as FrfSet
from .identification.fit import fit_modes as fit_modes
from .identification.options import FitOptions as FitOptions
from .ingest.estimate import estimate_frfs as estimate_frfs
from .ingest.options import IngestOptions as IngestOptions
from .ingest.test_file import read_test as read_test
from .pairing.assignment import pair as pair
from .pipeline.run import run_pipeline as run_pipeline
from .prediction.predict import predict_frfs as predict_frfs
from .quantities import FrfQuantity as FrfQuantity
from .runs.folder import read_run as read_run
from .updating.options import UpdateOptions as UpdateOptions
from .updating.update import update_model as update_model

__version__: str
