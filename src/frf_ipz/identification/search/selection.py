"""Which modes there are: poles added where the misfit has peaks, dropped where they are not significant."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy import linalg

from frf_ipz.arrays import BoolArray, ComplexArray, FloatArray
from frf_ipz.identification.likelihood.compression import Compressed, Weighted
from frf_ipz.identification.likelihood.refinement import Refined, refine
from frf_ipz.identification.likelihood.smooth_terms import SmoothTerms
from frf_ipz.identification.lines.measured import MeasuredLines, with_noise_of
from frf_ipz.identification.lines.noise import smooth_level
from frf_ipz.identification.search.candidates import find_candidates
from frf_ipz.numerics.partial_fractions import pair_columns, unstacked
from frf_ipz.rational import damping_ratio, natural_frequency_hz

MOST_ROUNDS = 3
GROWTH = 3 # a search adds at most one pole for so many there are, and two
WORST_DAMPING = 0.5

@dataclass
class Search:
    lines: MeasuredLines
    data: Weighted
    terms: SmoothTerms
    fit: Refined
    decisions: list = field(default_factory=list)

def response(system: Compressed, terms: SmoothTerms, s: ComplexArray) -> ComplexArray:
    columns = np.concatenate([terms.columns(s), pair_columns(s, system.poles)], axis=1)
    return unstacked(columns @ system.coefficients().T)

def white_misfit(st: Search) -> ComplexArray:
    return (st.data.receptance - response(st.fit.system, st.terms, st.data.s)) * st.data.weight

def gains(system: Compressed) -> FloatArray:
    """Increase of chi2 per pole and FRF if the pole left."""
    n, k, m = system.n_linear, system.n_smooth, system.n_poles
    c = system.scaled_coefficients()
    out = np.empty((m, len(c)))
    inv = [linalg.solve_triangular(U[:n, :n], np.eye(n)) for U in system.U]
    C = np.stack([i @ i.T for i in inv])
    for r in range(m):
        ix = [k + r, k + m + r]
        B = np.linalg.inv(C[:, ix][:, :, ix])
        x = c[:, ix]
        out[r] = np.einsum('fi,fij,fj->f', x, np.broadcast_to(B, (len(c), 2, 2)), x)
    return out

def levels(e: ComplexArray) -> FloatArray:
    return np.maximum(smooth_level(np.abs(e) ** 2) / 2, 1.0)

def significance(st: Search, e) -> FloatArray:
    lev = levels(e)
    f = st.lines.frequency_hz
    at = np.clip(np.searchsorted(f, natural_frequency_hz(st.fit.poles)), 0, len(f) - 1)
    g = gains(st.fit.system) / lev[at]
    F = g.shape[1]
    return g.sum(1) / ((2 * F + 2) * np.log(2 * len(f)))


def std_ratio(fit):
    n=len(fit.poles)
    try: C=np.linalg.inv(fit.information)
    except np.linalg.LinAlgError: return np.full(n,np.inf)
    return np.sqrt(np.abs(np.diag(C)))[:n]/-fit.poles.real

def search(lines, poles, terms, verbose=0):
    data = lines.weighted(shared=True)
    fit = refine(data, poles, terms, iterations=12)
    st = Search(lines=lines, data=data, terms=terms, fit=fit)
    black=np.zeros(0,complex)
    def skim(tst):
        nonlocal black
        while len(tst.fit.poles):
            e = white_misfit(tst)
            sig = significance(tst, e)
            lev=levels(e); f=lines.frequency_hz; at=np.clip(np.searchsorted(f, natural_frequency_hz(tst.fit.poles)), 0, len(f) - 1)
            sr = std_ratio(tst.fit)*np.sqrt(np.median(lev[at],1))
            bad = (sig < 1)|(sr>.3)
            if not bad.any(): break
            if verbose: print('   drop', [f'{a:.2f}:{b:.1f}:{c:.2f}' for a,b,c in zip(natural_frequency_hz(tst.fit.poles[bad]), sig[bad],sr[bad])])
            black=np.concatenate([black,tst.fit.poles[bad]])
            tst = replace(tst, fit=refine(data, tst.fit.poles[~bad], terms, iterations=12))
        return tst
    st=skim(st)
    for rnd in range(MOST_ROUNDS):
        e = white_misfit(st); lev=levels(e)
        most=2 + len(st.fit.poles) // GROWTH
        c1 = find_candidates(lines.frequency_hz, e , most)
        c2 = find_candidates(lines.frequency_hz, e / np.sqrt(lev), most)
        if verbose: print('round', rnd, 'poles', len(st.fit.poles), 'chi2/N', (np.abs(e)**2).mean()/2, 'median lev', np.median(levels(e)));print('   raw',np.round(natural_frequency_hz(c1.poles),2), np.round(c1.strength,1)); print('   nrm', np.round(natural_frequency_hz(c2.poles),2), np.round(c2.strength,1))
        cp=np.zeros(0,complex)
        for q in np.concatenate([c1.poles,c2.poles]):
            if len(cp) and (abs(cp-q)<2*abs(q.real)).any(): continue
            if len(black) and (abs(black.imag-q.imag)<2*np.maximum(abs(q.real),abs(black.real))).any(): continue
            cp=np.append(cp,q)
        if not len(cp): break
        old = st.fit.poles
        trial = refine(data, np.concatenate([old, cp]), terms, iterations=12)
        black=np.concatenate([black,trial.lost])
        tst = skim(replace(st, fit=trial))
        n=len(tst.fit.poles)
        if n<=len(old) and tst.fit.misfit>st.fit.misfit: continue
        st = tst
    st=replace(st,fit=refine(data,st.fit.poles,terms))
    e=white_misfit(st)
    return st, significance(st, e)
