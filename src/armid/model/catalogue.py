"""The plants and effects there are."""

from armid.model.effect import Effect
from armid.model.effects.balance import gas_heat_loss, line_loss
from armid.model.effects.bodies import added_inertia, gravity_gain, shell_rocking, tilt
from armid.model.effects.control import (
    controller_delay,
    position_gain,
    tachometer_lag,
    tachometer_offset,
    tachometer_ripple,
)
from armid.model.effects.drive import drive_gain, drive_lag, drive_saturation, worm_direction, worm_speed
from armid.model.effects.friction import (
    asymmetric_viscous,
    coulomb,
    load_friction,
    position_spring,
    presliding,
    quadratic_drag,
    seal_friction,
    stribeck,
    torque_offset,
    torque_ripple,
    viscous,
)
from armid.model.effects.motor import brush_drop, flux_saturation, supply_error, supply_sag, winding_heating
from armid.model.effects.sensor import gyro_bias, gyro_lag, gyro_scale, output_lag
from armid.model.plant import Plant
from armid.model.plants.driven_axis import driven_axis
from armid.model.plants.shell_transfer_arm import shell_transfer_arm

PLANTS: dict[str, Plant] = {p.name: p for p in (shell_transfer_arm, driven_axis)}
EFFECTS: dict[str, Effect] = {
    e.name: e
    for e in (
        # friction and other efforts on the shaft
        coulomb, stribeck, viscous, asymmetric_viscous, quadratic_drag, load_friction, presliding,
        seal_friction, torque_offset, torque_ripple, position_spring,
        # bodies and gravity
        shell_rocking, tilt, gravity_gain, added_inertia,
        # drive and gear
        drive_gain, drive_lag, drive_saturation, worm_direction, worm_speed,
        # motor and supply
        flux_saturation, brush_drop, winding_heating, supply_sag, supply_error,
        # balance machine
        gas_heat_loss, line_loss,
        # control
        tachometer_lag, tachometer_offset, tachometer_ripple, controller_delay, position_gain,
        # what is recorded
        gyro_lag, gyro_bias, gyro_scale, output_lag,
    )
}  # fmt: skip
