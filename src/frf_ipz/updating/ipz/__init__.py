"""Parts of the method ``ipz``: the published iteration of [Dorosti2018], doi:10.1016/j.conengprac.2017.11.002."""
