"""Three friction models of SciPy, fitted beside an image on the samples that `jointctl fit --export` or `evaluate --export` wrote.

a  inertia, gravity, viscous and Coulomb friction, offset: linear least squares.
b  a with Stribeck, asymmetric, quadratic, load-dependent and (where temperature was recorded) temperature terms.
c  b with a tanh network of three layers of five on what b leaves; of several seeds the best on validation samples.

All three are fitted to training and validation samples; c's network is trained on the training samples alone and stopped by the
validation samples. Nothing is fitted to, chosen by or scaled with a test sample, and the measured effort is no input of any model.
"""
