/* dsp/wisdom.h -- FFTW's measurements of this machine, kept between runs in
 * $XDG_CACHE_HOME/anlos (else ~/.cache/anlos), so that planning takes a millisecond
 * instead of seconds.  Call both from one thread; a failure costs time, nothing else. */
#ifndef ANLOS_DSP_WISDOM_H
#define ANLOS_DSP_WISDOM_H

/* Adds what is stored to what FFTW knows in this process.  0, -ENOENT (nothing stored, or
 * no home), -EINVAL (the file is no wisdom of this FFTW), other negative errno. */
int wisdom_load(void);

/* Replaces what is stored by what FFTW knows, at once or not at all; makes the folder.
 * 0, -ENOENT (no home), -ENOMEM, other negative errno (unwritable). */
int wisdom_save(void);

#endif
