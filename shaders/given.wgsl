// The responses that draw i of the range is given.
fn given_at(i: u32) -> Given {
    var given: Given;
    for (var j = 0u; j < COUNT; j++) {
        given[j] = givens[COUNT * i + j];
    }
    return given;
}
