"""The robot without hardware or waiting: whole drives in virtual time, through halls whose truth is known."""
